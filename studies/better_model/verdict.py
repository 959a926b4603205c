"""Print the effects that a diagnosis named, with commas between; none for the base model.

python studies/better_model/verdict.py base|diagnosed DIAGNOSIS_FOLDER
"""

import json
import sys
from pathlib import Path

NO_EFFECT = ("none", "unknown")


def verdict(model: str, folder: str) -> str:
    """Return the named effects as `effects=[…]` takes them."""
    if model == "base":
        return ""
    found = json.loads((Path(folder) / "diagnosis.json").read_text(encoding="utf-8"))
    return ",".join(name for name in found["verdict"] if name not in NO_EFFECT)


if __name__ == "__main__":
    print(verdict(*sys.argv[1:]))

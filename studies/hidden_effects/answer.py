"""Open a sealed answer: what was hidden in a measurement set.

python -m studies.hidden_effects.answer examples/hidden_effect/answer.sealed
"""

import argparse
from pathlib import Path
from typing import Any

from robotcast.files import unseal


def sentences(answer: dict[str, Any]) -> list[str]:
    """Say what was hidden, in the units of conf/effects.yaml."""
    if not answer["effects"]:
        return ["Nothing was hidden."]
    said = []
    for one in answer["effects"]:
        sizes = ", ".join(f"{name} = {value:.3g}" for name, value in one["parameters"].items())
        moved = f"{one['shift_percent']:.1f} % of cable length"
        said.append(f"Hidden was {one['effect']}: {sizes}. It moves the paths by {moved}.")
    return said


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sealed", type=Path)
    try:
        print(*sentences(unseal(parser.parse_args().sealed)), sep="\n")
    except (FileNotFoundError, ValueError) as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()

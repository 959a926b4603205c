"""The ParameterDict of `mujoco.sysid` as it stands on disk, a YAML file of plain numbers."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from robotcast.files import write_text


def read_parameters(path: Path) -> dict[str, dict[str, Any]]:
    """Return name → `lower`, `upper`, `start` and `frozen` of every parameter of one number.

    The value that was identified is where a fit starts.
    """
    if not path.is_file():
        raise ValueError(f"{path}: there is no such file; ParameterDict.save_to_disk writes it")
    found = {}
    try:
        for name, one in yaml.safe_load(path.read_text(encoding="utf-8")).items():
            if len(one["value"]) == 1:
                lower, upper, start = (one[k][0] for k in ("min_value", "max_value", "value"))
                numbers = {"lower": float(lower), "upper": float(upper), "start": float(start)}
                found[name] = {**numbers, "frozen": bool(one["frozen"])}
    except (AttributeError, KeyError, TypeError, ValueError, yaml.YAMLError):
        raise ValueError(f"{path}: not a ParameterDict of mujoco.sysid") from None
    return found


def write_parameters(path: Path, sizes: Mapping[str, Mapping[str, Any]]) -> None:
    """Write fitted parameters, `model.parameters` of diagnosis.json, as a ParameterDict.

    Bounds are the ends of their intervals; one without an interval is frozen.
    """
    said = {}
    for name, size in sizes.items():
        value = float(size["value"])
        ends = [value if size.get(end) is None else float(size[end]) for end in ("low", "high")]
        said[name] = {
            "name": name,
            "nominal": [value],
            "min_value": [min(ends[0], value)],
            "max_value": [max(ends[1], value)],
            "value": [value],
            "frozen": ends[0] == ends[1],
        }
    write_text(path, yaml.safe_dump(said, sort_keys=False))

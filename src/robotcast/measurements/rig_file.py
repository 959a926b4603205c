"""rig.yaml of a measurement set: the cable, the robot and the camera it was measured with."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from robotcast.measurements.measurement_set import Cable

MOST_M = 10.0
MOST_KG = 10.0
MOST_S = 10.0


@dataclass(frozen=True)
class RigFacts:
    """What rig.yaml says; the fields are those of `MeasurementSet`."""

    cable: Cable
    r0_m: float
    period_s: float
    noise_m: float | None
    rig: str


def read_rig_file(path: Path) -> RigFacts:
    """Read and check rig.yaml; messages name the key, since the file is short."""
    facts = _mapping(path)
    length_m = _length(path, facts, "cable.length_m")
    radius_m = _length(path, facts, "cable.radius_m")
    if radius_m >= length_m:
        raise ValueError(
            f"{path}: cable.radius_m {radius_m:g} is not below cable.length_m {length_m:g}; "
            "millimetres where metres are expected?"
        )
    cable = Cable(
        name=_name(path, facts, "cable.name"),
        length_m=length_m,
        mass_kg=_positive(path, facts, "cable.mass_kg", MOST_KG, "grams where kilograms"),
        radius_m=radius_m,
        endpoint_mass_kg=_not_negative(
            path, facts, "cable.endpoint_mass_kg", MOST_KG, "grams where kilograms"
        ),
    )
    noise_known = _find(facts, "camera.noise_m") is not None
    return RigFacts(
        cable=cable,
        r0_m=_length(path, facts, "robot.r0_m"),
        period_s=_positive(path, facts, "camera.period_s", MOST_S, "milliseconds where seconds"),
        noise_m=_not_negative(path, facts, "camera.noise_m", MOST_M, "millimetres where metres")
        if noise_known
        else None,
        rig=_name(path, facts, "rig") if "rig" in facts else "recorded",
    )


def rig_file_text(facts: RigFacts) -> str:
    """Return rig.yaml for `facts`, numbers with all their digits."""
    camera = {"period_s": float(facts.period_s)}
    if facts.noise_m is not None:
        camera["noise_m"] = float(facts.noise_m)
    content = {
        "rig": facts.rig,
        "cable": {
            "name": facts.cable.name,
            "length_m": float(facts.cable.length_m),
            "mass_kg": float(facts.cable.mass_kg),
            "radius_m": float(facts.cable.radius_m),
            "endpoint_mass_kg": float(facts.cable.endpoint_mass_kg),
        },
        "robot": {"r0_m": float(facts.r0_m)},
        "camera": camera,
    }
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True)


def _mapping(path: Path) -> dict[str, Any]:
    try:
        facts = yaml.safe_load(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        raise ValueError(f"{path}: is not text in UTF-8") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"{path} line {mark.line + 1}" if mark else f"{path}"
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise ValueError(f"{place}: is not YAML ({problem})") from None
    if not isinstance(facts, dict):
        raise ValueError(f"{path}: expected the keys cable, robot and camera, got {facts!r}")
    return facts


def _find(facts: dict[str, Any], key: str) -> Any:
    value: Any = facts
    for part in key.split("."):
        value = value.get(part) if isinstance(value, dict) else None
    return value


def _name(path: Path, facts: dict[str, Any], key: str) -> str:
    value = _find(facts, key)
    if value is None or isinstance(value, dict | list) or not str(value).strip():
        raise ValueError(f"{path}: {key} must be a name, got {_said(value)}")
    return str(value)


def _number(path: Path, facts: dict[str, Any], key: str) -> float:
    value = _find(facts, key)
    # YAML 1.1 reads 1e-3, without a dot, as a word.
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"{path}: {key} must be a finite number, got {_said(value)}")
    try:
        number = float(value)
    except (ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{path}: {key} must be a finite number, got {value!r}")
    return number


def _not_negative(path: Path, facts: dict[str, Any], key: str, most: float, mistaken: str) -> float:
    number = _number(path, facts, key)
    if number < 0:
        raise ValueError(f"{path}: {key} must not be negative, got {number:g}")
    if number > most:
        raise ValueError(f"{path}: {key} is {number:g}, beyond {most:g}; {mistaken} are expected?")
    return number


def _positive(path: Path, facts: dict[str, Any], key: str, most: float, mistaken: str) -> float:
    number = _not_negative(path, facts, key, most, mistaken)
    if number == 0:
        raise ValueError(f"{path}: {key} must be above zero, got 0")
    return number


def _length(path: Path, facts: dict[str, Any], key: str) -> float:
    return _positive(path, facts, key, MOST_M, "millimetres where metres")


def _said(value: Any) -> str:
    return "nothing" if value is None else repr(value)

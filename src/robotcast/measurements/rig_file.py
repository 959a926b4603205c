"""rig.yaml of a measurement set: the cable, the robot and the camera it was measured with."""

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import yaml

from robotcast.measurements.measurement_set import Cable

MOST = 10.0  # m, kg or s, of every number
MISTAKEN = {
    "m": "millimetres where metres",
    "kg": "grams where kilograms",
    "s": "milliseconds where seconds",
}
MAY_BE_ZERO = ("cable.endpoint_mass_kg", "camera.noise_m")


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
    names = ("length_m", "mass_kg", "radius_m", "endpoint_mass_kg")
    sizes = {name: _number(path, facts, f"cable.{name}") for name in names}
    if sizes["radius_m"] >= sizes["length_m"]:
        raise ValueError(
            f"{path}: cable.radius_m {sizes['radius_m']:g} is not below cable.length_m "
            f"{sizes['length_m']:g}; millimetres where metres are expected?"
        )
    noise_known = _find(facts, "camera.noise_m") is not None
    return RigFacts(
        cable=Cable(name=_name(path, facts, "cable.name"), **sizes),
        r0_m=_number(path, facts, "robot.r0_m"),
        period_s=_number(path, facts, "camera.period_s"),
        noise_m=_number(path, facts, "camera.noise_m") if noise_known else None,
        rig=_name(path, facts, "rig") if "rig" in facts else "recorded",
    )


def rig_file_text(facts: RigFacts) -> str:
    """Return rig.yaml for `facts`, numbers with all their digits."""
    cable = {k: v if k == "name" else float(v) for k, v in asdict(facts.cable).items()}
    camera = {"period_s": float(facts.period_s)}
    if facts.noise_m is not None:
        camera["noise_m"] = float(facts.noise_m)
    robot = {"r0_m": float(facts.r0_m)}
    content = {"rig": facts.rig, "cable": cable, "robot": robot, "camera": camera}
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
    value, number = _find(facts, key), math.nan
    # YAML 1.1 reads 1e-3, without a dot, as a word.
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        try:
            number = float(value)
        except (ValueError, OverflowError):
            number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{path}: {key} must be a finite number, got {_said(value)}")
    if number < 0:
        raise ValueError(f"{path}: {key} must not be negative, got {number:g}")
    if number == 0 and key not in MAY_BE_ZERO:
        raise ValueError(f"{path}: {key} must be above zero, got 0")
    if number > MOST:
        mistaken = MISTAKEN[key.rpartition("_")[2]]
        raise ValueError(f"{path}: {key} is {number:g}, beyond {MOST:g}; {mistaken} are expected?")
    return number


def _said(value: Any) -> str:
    return "nothing" if value is None else repr(value)

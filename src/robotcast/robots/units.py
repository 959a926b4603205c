"""Units of logged columns: everything is converted to SI once, here."""

import math

ANGLE = {"rad": 1.0, "deg": math.pi / 180, "mrad": 1e-3, "rev": 2 * math.pi}
LENGTH = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6}
UNITS = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "rad": ANGLE,
    "m": LENGTH,
    "rad/s": {**{f"{u}/s": f for u, f in ANGLE.items()}, "rpm": 2 * math.pi / 60},
    "m/s": {f"{u}/s": f for u, f in LENGTH.items()},
    "N m": {"N m": 1.0, "Nm": 1.0, "mN m": 1e-3, "mNm": 1e-3},
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
}
CURRENT = {"A": 1.0, "mA": 1e-3}


def to_si(unit: str | None, wanted: str, torque_constant: float | None, where: str) -> float:
    """Return what a value in `unit` is multiplied by to be in the SI unit `wanted`.

    A current is one of torque through the `torque_constant` [N m/A]. An empty `wanted`, of
    controls and sensors, takes any of the units.
    """
    if torque_constant is not None or unit in CURRENT:
        if unit not in CURRENT or torque_constant is None:
            raise ValueError(f"{where}: a current needs unit A or mA and a torque_constant [N m/A]")
        return CURRENT[unit] * float(torque_constant)
    if unit is None:
        return 1.0
    known = UNITS.get(wanted) or {u: f for some in UNITS.values() for u, f in some.items()}
    if unit not in known:
        raise ValueError(
            f"{where}: the unit {unit!r} is none of {', '.join(known)}; for another one give "
            f"scale: what a value is multiplied by to be in {wanted or 'the unit of the model'}"
        )
    return known[unit]

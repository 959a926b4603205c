"""How the numbers of an action, and those along an axis, are written."""

_SYMBOLS = {
    "theta1": "θ₁",
    "theta2": "θ₂",
    "alpha": "α",
    "r1": "r₁",
    "r2": "r₂",
    "vmax": "v_max",
}


def factor_name(name: str) -> str:
    """theta1 → θ₁; a name without a symbol stays."""
    return _SYMBOLS.get(name, name.replace("_", " "))


def factor_label(name: str, unit: str) -> str:
    """theta1, rad → θ₁ [rad]."""
    return factor_name(name) if unit in ("", "1") else f"{factor_name(name)} [{unit}]"


def tick_label(value: float) -> str:
    """Write a round number along an axis: 0.5, −2."""
    return f"{value:g}".replace("-", "−")

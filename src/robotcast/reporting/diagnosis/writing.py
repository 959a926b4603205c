"""A start for an effect of one's own: a class and its YAML, after what the force depends on."""

from dataclasses import dataclass

from robotcast.reporting.diagnosis.field import focus
from robotcast.reporting.diagnosis.reading import Field, Unexplained


@dataclass(frozen=True)
class Draft:
    """What to write into which file."""

    path: str
    text: str


@dataclass(frozen=True)
class _Law:
    doc: str
    parameters: tuple[str, ...]
    lines: tuple[str, ...]
    unit: str = "1/s²"
    upper: float = 50.0


_LAWS = {
    "place": _Law(
        "Pulls towards a place: f = k m (p0 − p).",
        ("k", "x0", "y0"),
        ("return k * {mass} * (x0 - cable.x), k * {mass} * (y0 - cable.y)",),
    ),
    "resistance of place": _Law(
        "Brakes about a place: f = −k m v e^(−|p − p0|² / 0.04 m²).",
        ("k", "x0", "y0"),
        (
            "near = np.exp(-((cable.x - x0) ** 2 + (cable.y - y0) ** 2) / 0.04)",
            "return -k * {mass} * near * cable.vx, -k * {mass} * near * cable.vy",
        ),
        "1/s",
    ),
    "speed": _Law(
        "Brakes with speed: f = −k m v.",
        ("k",),
        ("return -k * {mass} * cable.vx, -k * {mass} * cable.vy",),
        "1/s",
    ),
    "heading": _Law(
        "Pushes across the cable: f = k m n, n the normal to the left.",
        ("k",),
        ("return -k * {mass} * cable.ty, k * {mass} * cable.tx",),
        "m/s²",
    ),
    "time": _Law(
        "Brakes more as time goes on: f = −k m t v.",
        ("k",),
        ("late = k * {mass} * cable.time_s", "return -late * cable.vx, -late * cable.vy"),
    ),
    "bending": _Law(
        "Resists bending: M = −k κ in every hinge.",
        ("k",),
        ("return -k * cable.curvature",),
        "N m²",
        1e-3,
    ),
    "endpoint": _Law(
        "Brakes the endpoint alone: f = −k m v.",
        ("k",),
        ("return -k * {mass} * cable.vx, -k * {mass} * cable.vy",),
        "1/s",
    ),
}


def drafts(unexplained: Unexplained) -> tuple[Draft, ...]:
    """Return the files to write, with a law that fits what the force depends on."""
    law = _LAWS.get(_kind(unexplained), _LAWS["place"])
    return (
        Draft("src/robotcast/effects/my_effect.py", _class(law, _at_end(unexplained))),
        Draft("conf/effects.yaml", _yaml(law, unexplained)),
    )


def _kind(unexplained: Unexplained) -> str:
    """Return the law to start from: numbers over the board are a resistance, arrows a force."""
    field = unexplained.field
    scalar = field is not None and len(field.axes) == 2 and len(field.values[0]) == 1
    return "resistance of place" if scalar else unexplained.depends_on


def _at_end(unexplained: Unexplained) -> bool:
    """Tell whether the force acts on the free end alone."""
    acts_on = unexplained.field.acts_on if unexplained.field else ""
    return unexplained.depends_on == "endpoint" or "end" in acts_on


def _class(law: _Law, at_end: bool) -> str:
    mass = "cable.on_endpoint(cable.mass_kg[:, -1:])" if at_end else "cable.mass_kg"
    hook = "bending_moment" if "curvature" in law.lines[-1] else "force"
    body = [f"        {row.format(mass='mass')}" for row in law.lines]
    if hook == "force":
        body.insert(0, f"        mass = {mass}")
    return "\n".join(
        [
            *(["import numpy as np", ""] if "np." in law.lines[0] else []),
            "from robotcast.effects.effect import Effect",
            "",
            "",
            "class MyEffect(Effect):",
            f'    """{law.doc}"""',
            "",
            f"    def {hook}(self, cable, *, {', '.join(law.parameters)}):",
            *body,
        ]
    )


def _yaml(law: _Law, unexplained: Unexplained) -> str:
    bound, small, large = (_decimal(law.upper / part) for part in (1, 50, 10))
    lines = [
        "effects:",
        "  my_effect:",
        "    _target_: robotcast.effects.my_effect.MyEffect",
        "    text: what it is, in a few words",
        "    parameters:",
        f'      k: {{ unit: "{law.unit}", lower: -{bound}, upper: {bound}, null_at: 0.0, '
        f"probes: [{small}, {large}] }}",
    ]
    if "x0" in law.parameters:
        x, y = (f"{at:.2f}" for at in _place(unexplained.field))
        lines += [
            f"      x0: {{ unit: m, lower: 0.0, upper: 1.6, nominal: {x}, probes: [{x}] }}",
            f"      y0: {{ unit: m, lower: -1.2, upper: 1.2, nominal: {y}, probes: [{y}] }}",
        ]
    return "\n".join(lines)


def _place(field: Field | None) -> tuple[float, float]:
    """Return the place that arrows point at, or where numbers are largest."""
    if field is not None and len(field.values[0]) == 1:
        strongest = max(zip(field.values, field.points, strict=True))
        return strongest[1][0], strongest[1][1]
    aimed = focus(field) if field else None
    return (float(aimed[0][0]), float(aimed[0][1])) if aimed else (0.9, 0.0)


def _decimal(value: float) -> str:
    """Write a number without an exponent, which YAML would take for text."""
    return f"{value:.6f}".rstrip("0").rstrip(".")

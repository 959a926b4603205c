"""What a domain calls its things, so that findings about any model read plainly."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True)
class Axis:
    """One component of the measured signal.

    Attributes
    ----------
    above, below : where large and small values lie, "on the left"; empty when they have no name.
    scale : what 1 of the signal is in the unit, where it counts in units of its own.
    """

    name: str
    unit: str
    above: str = ""
    below: str = ""
    scale: float = 1.0


@dataclass(frozen=True)
class Wording:
    """The words of one domain.

    Attributes
    ----------
    trial, trials, sample, samples : what one trial and one of its samples are called.
    group, groups : what trials repeat, "action".
    mover : what is tracked, "the free end".
    floor : what no model can come below, "repeats differ by".
    axes : of the signal, in order; empty when they have no names.
    factor_units : factor → unit.
    """

    trial: str = "trial"
    trials: str = "trials"
    sample: str = "sample"
    samples: str = "samples"
    group: str = "action"
    groups: str = "actions"
    mover: str = "the signal"
    floor: str = "repeats differ by"
    axes: Sequence[Axis] = ()
    factor_units: Mapping[str, str] = field(default_factory=dict)

    def axis(self, index: int) -> Axis:
        """Return component `index`, under a made-up name when the domain gave none."""
        return self.axes[index] if index < len(self.axes) else Axis(f"signal {index + 1}", "")

    def in_plane(self, d: int) -> bool:
        """Tell whether a signal of `d` components is a place in a plane."""
        first, second = self.axis(0), self.axis(1)
        lengths = first.unit == second.unit and first.unit in ("", "m", "cm", "mm")
        return d == 2 and lengths and first.scale == second.scale

    def factor(self, name: str, value: str) -> str:
        """Return a factor's value as it is read, "alpha 1.6 rad" without the name."""
        unit = self.factor_units.get(name, "")
        return f"{value} {unit}" if unit not in ("", "1") else value

    def as_dict(self, d: int) -> dict[str, Any]:
        """Return the words as plain data for a signal of `d` components."""
        nouns = ("trial", "trials", "sample", "samples", "group", "groups")
        return {
            **{name: getattr(self, name) for name in nouns},
            "mover": self.mover,
            **({} if self.floor == Wording.floor else {"floor": self.floor}),
            "axes": [asdict(self.axis(i)) for i in range(d)],
            "plane": self.in_plane(d),
            "factor_units": dict(self.factor_units),
        }


PLAIN = Wording()


def parameter_name(name: str, unit: str) -> str:
    """Return a parameter's name as it is read: cable_mass_kg, kg → cable mass."""
    suffix = "_" + unit.lower().replace(" ", "_").replace("²", "2").replace("/", "_per_")
    return name.removesuffix(suffix).replace("_", " ")

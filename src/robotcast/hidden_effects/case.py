"""One case of the benchmark, as it is drawn before anything is simulated."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

from robotcast.hidden_effects.mechanisms import Parameters, make_effect
from robotcast.rigs.virtual.rig import VirtualRig

Kind = Literal["control", "single", "pair", "outside"]


@dataclass(frozen=True)
class Case:
    """What a case is made of.

    Attributes
    ----------
    name : says nothing about what is hidden.
    kind : nothing hidden, one effect or two of the library, one mechanism outside it.
    cable : which of the rigs it is measured on.
    seed : of its actions and of the rig's chance.
    truth : how many times as large as the cable's own each of these numbers of `CableTruth` is.
    hidden : mechanism → its place (`Mechanism.place`); its size is fitted to `wanted_percent`.
    strength : how the size is called, "" where nothing is hidden.
    wanted_percent : by how far each hidden mechanism shall move the paths, in % of cable length.
    outliers : casts whose tracking went astray.
    noise_s : growth of the tracking noise with speed [m per m/s].
    """

    name: str
    kind: Kind
    cable: str
    seed: int
    truth: Mapping[str, float] = field(default_factory=dict)
    hidden: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    strength: str = ""
    wanted_percent: float = 0.0
    outliers: int = 0
    noise_s: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """Return the case as JSON can hold it."""
        return asdict(self)

    def rig(self, nominal: VirtualRig, hidden: Mapping[str, Parameters]) -> VirtualRig:
        """Return the rig of this case with `hidden` (mechanism → parameters) at work."""
        factors = {name: getattr(nominal.truth, name) * f for name, f in self.truth.items()}
        return replace(
            nominal,
            truth=replace(nominal.truth, **factors),
            seed=self.seed,
            hidden=tuple(make_effect(name, given) for name, given in hidden.items()),
        )

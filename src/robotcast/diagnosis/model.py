"""What diagnosis sees: measured trials, a model that predicts them, and what all is called."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Protocol

import numpy as np

from robotcast.fitting.parameter import Parameter


@dataclass(frozen=True)
class Record:
    """One trial: what was commanded and what was measured."""

    trial: int  # its number in the data
    group: int  # trials of one action share it; they are repeats, and no split cuts them apart
    times_s: np.ndarray  # (k,)
    measured: np.ndarray  # (k, d), in the model's unit
    # name → commanded number, to look for patterns in the error
    factors: Mapping[str, float] = field(default_factory=dict)
    # name → start [s] of each phase of the motion, in order
    phases: Mapping[str, float] = field(default_factory=dict)
    # what else no split may cut apart, as windows of one log, shares it; by default the group
    held_out_with: int | None = None
    ended: bool = True  # its last sample is where it ended; no final error counts another

    @property
    def together(self) -> int:
        """Trials that no split may cut apart share this number."""
        return self.group if self.held_out_with is None else self.held_out_with


class Candidate(Protocol):
    """A mechanism that the model may lack.

    `parameters` with a `null` are its strengths: at null it does nothing. Those without one say
    where or how it acts. `text` says in a few words what it is. `depends_on` is None for a
    mechanism with a name; for a flexible field that stands for any mechanism, it is what that
    may depend on: "place", "speed", "heading", "time", "bending" or "endpoint". Any may have a
    `guess`: parameters from which a fit starts beside those that its slopes promise.
    """

    @property
    def name(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def parameters(self) -> tuple[Parameter, ...]: ...
    @property
    def depends_on(self) -> str | None: ...


class Model(Protocol):
    """Anything that maps trials, active effects and parameter vectors to signals.

    Attributes
    ----------
    parameters : of the base model.
    effects : name → candidate, fields included.
    scale : errors are given in % of this length (a cable's length; 1 for metres).
    error_unit : what an error of `scale` / 100 is called, "% of cable length".

    A model that is simulated in steps may have `finer` too, the same model with a shorter step:
    what the two differ by widens the intervals of sizes.
    """

    @property
    def parameters(self) -> tuple[Parameter, ...]: ...
    @property
    def effects(self) -> Mapping[str, Candidate]: ...
    @property
    def scale(self) -> float: ...
    @property
    def error_unit(self) -> str: ...

    def predict(
        self, records: Sequence[Record], active: Sequence[str], vectors: np.ndarray
    ) -> np.ndarray:
        """Predict the signals of every trial, at its `times_s`, under every parameter vector.

        `active` names the effects that act; `vectors` (n_vectors, n) hold the base parameters in
        order, then those of every active effect in the order of `active`. The signals are
        (n_vectors, n_trials, k_max, d), NaN past a trial's own k samples and where a run diverged.

        It is called for one batch at a time, never from several threads, and also for the
        beginnings of trials.
        """
        ...


@dataclass(frozen=True)
class Axis:
    """One component of the measured signal."""

    name: str
    unit: str
    above: str = ""  # where large values lie, "on the left"; empty when that has no name
    below: str = ""  # where small values lie
    scale: float = 1.0  # what 1 of the signal is in the unit, where it counts in units of its own


@dataclass(frozen=True)
class Wording:
    """The words of one domain."""

    # what one trial and one of its samples are called
    trial: str = "trial"
    trials: str = "trials"
    sample: str = "sample"
    samples: str = "samples"
    group: str = "action"  # what trials repeat
    groups: str = "actions"
    mover: str = "the signal"  # what is tracked, "the free end"
    floor: str = "repeats differ by"  # what no model can come below
    # what a model predicts in which nothing acts, "joints that go on as they moved"
    idle: str = "a model in which nothing acts"
    axes: Sequence[Axis] = ()  # of the signal, in order; empty when they have no names
    factor_units: Mapping[str, str] = field(default_factory=dict)  # factor → unit

    def axis(self, index: int) -> Axis:
        """Return component `index`, under a made-up name when the domain gave none."""
        return self.axes[index] if index < len(self.axes) else Axis(f"signal {index + 1}", "")

    def numbered(self, trials: Sequence[int]) -> str:
        """Return trials as they are read, "casts 3, 4 and 7"."""
        *first, last = map(str, sorted(trials))
        return f"{self.trials} {', '.join(first)} and {last}" if first else f"{self.trial} {last}"

    def in_plane(self, d: int) -> bool:
        """Tell whether a signal of `d` components is a place in a plane."""
        first, second = self.axis(0), self.axis(1)
        lengths = first.unit == second.unit and first.unit in ("", "m", "cm", "mm")
        return d == 2 and lengths and first.scale == second.scale

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

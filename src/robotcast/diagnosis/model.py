"""What diagnosis sees: trials that were measured, and a model that predicts them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from robotcast.fitting.parameter import Parameter


@dataclass(frozen=True)
class Record:
    """One trial: what was commanded and what was measured.

    Attributes
    ----------
    trial : its number in the data.
    group : trials of one action share it; they are repeats, and no split cuts them apart.
    held_out_with : what else no split may cut apart, as windows of one log, shares this number;
        by default the group.
    ended : its last sample is where it ended; no final error counts another.
    times_s : ndarray of shape (k,).
    measured : ndarray of shape (k, d), in the model's unit.
    factors : name → commanded number, to look for patterns in the error.
    phases : name → start [s] of each phase of the motion, in order.
    """

    trial: int
    group: int
    times_s: np.ndarray
    measured: np.ndarray
    factors: Mapping[str, float] = field(default_factory=dict)
    phases: Mapping[str, float] = field(default_factory=dict)
    held_out_with: int | None = None
    ended: bool = True


class Candidate(Protocol):
    """A mechanism that the model may lack.

    `parameters` with a `null` are its strengths: at null it does nothing. Those without one say
    where or how it acts. `text` says in a few words what it is. `depends_on` is None for a
    mechanism with a name; for a flexible field that stands for any mechanism, it is what that
    may depend on: "place", "speed", "heading", "time", "bending" or "endpoint".
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

        It is called for one batch at a time, never from several threads, and also for the
        beginnings of trials.

        Parameters
        ----------
        active : names of the effects that act.
        vectors : ndarray of shape (n_vectors, n), the base parameters in order, then those of
            every active effect in the order of `active`.

        Returns
        -------
        ndarray of shape (n_vectors, n_trials, k_max, d); NaN past a trial's own k samples and
        where a run diverged.
        """
        ...

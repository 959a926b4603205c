"""A second look at every effect: acting at its probes, with the model's own parameters refitted.

The first look is linear, and misses an effect for which the parameters of the model have moved
far away to stand in for it. Here each effect acts at a size that would matter, and the model's
own parameters find their way back on the beginnings of some trials, where fits run smoothly.
"""

from collections.abc import Iterable

import numpy as np

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.revision import EARLY, SOME, Revision, held_out
from robotcast.diagnosis.search.screen import Screened
from robotcast.diagnosis.side_by_side import side_by_side
from robotcast.fitting.least_squares import Fit, trial_losses

HOPE = 0.02  # share of the loss that an effect must take away to be looked at further
BEHIND = 1.5  # times the best one's loss, beyond which only the second best goes on
LEFT = (6, 4)  # effects that the fits go on with after the first step, and after the next two


class Profile:
    """A revision beside the beginnings of some trials.

    Attributes
    ----------
    early : the inquiry into these beginnings.
    revision : fitted to them.
    """

    def __init__(
        self, inquiry: Inquiry, effects: tuple[str, ...], vector: np.ndarray, iterations: int = 1
    ) -> None:
        """Fit the model with these effects to the beginnings, from a unit vector (n,)."""
        self.early = inquiry.beginnings(EARLY, SOME)
        self.revision = Revision(effects, self.early.fit(effects, vector, iterations))

    @classmethod
    def of(cls, inquiry: Inquiry, revision: Revision) -> "Profile":
        """Return the profile of a fitted revision."""
        return cls(inquiry, revision.effects, revision.fit.vector)

    def contenders(self, looked: Iterable[Screened], most: int) -> list[tuple[str, Fit]]:
        """Return at most so many effects that lower the loss, each with its fit; the best first.

        All begin; after every step those that lowered the loss least are left out.
        """
        most_loss = (1 - HOPE) * self.revision.fit.loss
        begun = side_by_side(lambda one: (one.effect, self._begun(one.effect, one)), list(looked))
        ranked = sorted(begun, key=_loss)
        for left in LEFT:
            on = [(name, self._on(name, fit)) for name, fit in ranked[: min(left, 2 * most)]]
            ranked = sorted(on, key=_loss)
        hopeful = [one for one in ranked if _loss(one) < most_loss][:most]
        return hopeful[:2] + [one for one in hopeful[2:] if _loss(one) < BEHIND * _loss(hopeful[0])]

    def with_field(self, one: Screened) -> Fit:
        """Return the fit with a field: so many strengths have no probe that stands for all."""
        return self.early.fit((*self.revision.effects, one.effect), one.start, 1)

    def errors(self, name: str, fit: Fit) -> np.ndarray:
        """Return the average errors with an effect, held out, % of the scale."""
        return self._held_out(Revision((*self.revision.effects, name), fit))

    def own_errors(self) -> np.ndarray:
        """Return the average errors of the revision itself, held out, % of the scale."""
        return self._held_out(self.revision)

    def _held_out(self, revision: Revision) -> np.ndarray:
        return held_out(self.early, revision, seed=0, iterations=1).waypoint

    def _begun(self, name: str, one: Screened) -> Fit:
        """Return the best of one step from every probe, and from where the first look points."""
        active = (*self.revision.effects, name)
        probes, strengths, moves = self._probes(name, one)
        rows = np.vstack([probes, one.start])
        values = self.early.residuals(active)(rows, self.early.everything)
        slopes = self._slopes(values[:-1], strengths, moves, n=rows.shape[1])
        stepped = []
        for row, residual in zip(rows, values, strict=True):
            known = Fit(row, float(trial_losses(residual).mean()), residual, slopes)
            stepped.append(self.early.fit(active, row, 1, known=known))
        return min(stepped, key=lambda fit: fit.loss)

    def _on(self, name: str, fit: Fit) -> Fit:
        """Go on with a fit: a step with the slopes that it has, and one with fresh ones."""
        active = (*self.revision.effects, name)
        return self.early.fit(active, fit.vector, 2, known=fit)

    def _probes(self, name: str, one: Screened) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return unit vectors with one strength of the effect at a probe, at the best place.

        Beside them, each (n_rows,): which strength that is, and by how much it moved from null.
        """
        own = self.early.model.effects[name].parameters
        at_null = [
            p.to_unit(np.asarray(p.null)) if p.null is not None else place
            for p, place in zip(own, one.start[-len(own) :], strict=True)
        ]
        rows, strengths, moves = [], [], []
        for k, parameter in enumerate(own):
            for probe in parameter.probes if parameter.null is not None else ():
                units = np.array(at_null, float)
                units[k] = parameter.to_unit(np.asarray(probe))
                rows.append(np.concatenate([self.revision.fit.vector, units]))
                strengths.append(len(self.revision.fit.vector) + k)
                moves.append(units[k] - at_null[k])
        return np.array(rows), np.array(strengths), np.array(moves)

    def _slopes(
        self, values: np.ndarray, strengths: np.ndarray, moves: np.ndarray, n: int
    ) -> np.ndarray:
        """Return the Jacobian (n_trials, D, n): the revision's, and strengths through probes."""
        slopes = np.zeros((*self.revision.fit.jacobian.shape[:2], n))
        slopes[:, :, : len(self.revision.fit.vector)] = self.revision.fit.jacobian
        for k in np.unique(strengths):
            mine = strengths == k
            rise = np.tensordot(moves[mine], values[mine] - self.revision.fit.residual, axes=1)
            slopes[:, :, k] = rise / (moves[mine] ** 2).sum()
        return slopes


def _loss(named: tuple[str, Fit]) -> float:
    return named[1].loss

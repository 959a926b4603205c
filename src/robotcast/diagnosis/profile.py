"""A second look at every effect: acting at its probes, with the model's own parameters refitted.

The first look is linear, and misses an effect for which the parameters of the model have moved
far away to stand in for it. Here each effect acts at a size that would matter, and the model's
own parameters find their way back on the beginnings of some trials, where fits run smoothly.
"""

from collections.abc import Mapping

import numpy as np

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.revision import EARLY, SOME, Revision, spread
from robotcast.diagnosis.screen import Screened
from robotcast.fitting.least_squares import Fit, fit_robustly, trial_losses

HOPE = 0.005  # share of the loss that an effect must take away to be looked at further


class Profile:
    """A revision beside the beginnings of some trials.

    Attributes
    ----------
    loss : of the revision there.
    """

    def __init__(self, inquiry: Inquiry, revision: Revision) -> None:
        self._early = inquiry.beginnings(EARLY)
        self._trials = spread(inquiry.everything, SOME)
        self._effects = revision.effects
        fit = self._early.fit(revision.effects, revision.fit.vector, 1, trials=self._trials)
        self._fit = fit
        self.loss = fit.loss

    def contenders(self, looked: Mapping[str, Screened], most: int) -> list[tuple[str, Fit]]:
        """Return the effects that lower the loss most, each with its fit; the best first."""
        begun = sorted(
            (self._best_probe(name, one) for name, one in looked.items()),
            key=lambda pair: pair[1].loss,
        )
        fits = [(name, self._fitted(name, fit.vector)) for name, fit in begun[:most]]
        hopeful = [(name, fit) for name, fit in fits if fit.loss < (1 - HOPE) * self.loss]
        return sorted(hopeful, key=lambda pair: pair[1].loss)

    def _fitted(self, name: str, start: np.ndarray) -> Fit:
        return self._early.fit((*self._effects, name), start, 3, trials=self._trials)

    def _best_probe(self, name: str, one: Screened) -> tuple[str, Fit]:
        """Return the effect with the probe to which the model's parameters adapt best."""
        active = (*self._effects, name)
        residuals, rows = self._early.residuals(active), self._rows(name, one)
        values = residuals(rows, self._trials)
        n = len(rows[0]) - len(self._fit.vector)
        padded = np.pad(self._fit.jacobian, ((0, 0), (0, 0), (0, n)))
        free = self._early.free(active)
        free[-n:] = False
        fits = []
        for row, residual in zip(rows, values, strict=True):
            known = Fit(row, float(trial_losses(residual).mean()), residual, padded)
            steps = self._early.steps(active)
            fits.append(
                fit_robustly(
                    residuals, row, steps, self._trials, iterations=1, known=known, free=free
                )
            )
        return name, min(fits, key=lambda fit: fit.loss)

    def _rows(self, name: str, one: Screened) -> np.ndarray:
        """Return unit vectors with one strength of the effect at a probe, at the best place."""
        own = self._early.model.effects[name].parameters
        at_null = [
            p.to_unit(np.asarray(p.null)) if p.null is not None else place
            for p, place in zip(own, one.start[-len(own) :], strict=True)
        ]
        rows = []
        for k, parameter in enumerate(own):
            for probe in parameter.probes if parameter.null is not None else ():
                units = np.array(at_null, float)
                units[k] = parameter.to_unit(np.asarray(probe))
                rows.append(np.concatenate([self._fit.vector, units]))
        return np.array(rows)

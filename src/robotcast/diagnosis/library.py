"""The whole library at once: the model with every effect that may be missing, fitted together.

Effects that must act together are not found one by one, and a model that was tuned without the
one that is missing has moved into a valley from which that one no longer helps. So all effects
are let in at the same time, each expected near its null by a few of its probes, and the fit
starts from the nominal parameters as well as from the tuned ones. It predicts about as well as
any set of effects could; its slopes then tell which few of them would do as well (the idea of a
saturated model that is pruned; Tipping 2001 on why so many parameters do no harm when each is
held by a prior).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, product

import numpy as np

from robotcast.diagnosis.errors import Floor, typical, usual, worse
from robotcast.diagnosis.inquiry import STEPPING, Inquiry
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.fitting.least_squares import Fit, trial_losses

EDGE = 0.01  # of a range, from which a start keeps clear


def fit_library(
    early: Inquiry, fixed: Sequence[str], candidates: Sequence[str], base: Fit, iterations: int
) -> "Library":
    """Fit the model with all effects to beginnings of trials.

    Parameters
    ----------
    early : the inquiry into the beginnings.
    fixed : effects of the base model.
    base : fit of the base model to them, where the other start is; the only one where that has
        nothing to fit.
    """
    nominal = [early.fit(fixed, early.nominal(fixed), 0)] if early.free(fixed).any() else []
    starts = tuple(library_at(early, fixed, candidates, fit) for fit in (*nominal, base))
    effects = starts[0].effects
    fits = [early.fit(effects, some.fit.vector, 2, known=some.fit) for some in starts]
    best = min(fits, key=lambda fit: fit.loss)
    guess = early.guessed(effects, starts[0].fit.vector, candidates)
    if guess is not None:
        begun = early.fit(effects, guess, 0)
        guess = guess if begun.loss < best.loss else None
        best = best if guess is None else early.fit(effects, guess, 2, known=begun)
    best = early.fit(effects, best.vector, iterations - 2, known=best)
    return Library(early, effects, best, starts, guess)


def library_at(
    early: Inquiry, fixed: Sequence[str], candidates: Sequence[str], base: Fit
) -> "Library":
    """Return all effects at their null beside the parameters of a fit, known by their slopes."""
    effects = (*fixed, *candidates)
    places = [_best_place(early, (*fixed, name), base) for name in candidates]
    vector, one_sided = np.concatenate([base.vector, *places]), replace(STEPPING, central=False)
    return Library(early, effects, early.fit(effects, vector, 0, stepping=one_sided))


def _best_place(early: Inquiry, acting: tuple[str, ...], base: Fit) -> np.ndarray:
    """Return the last effect's unit values, strengths at null, at the place that promises most.

    Parameters that are no strengths say where or how it acts; away from its null they are
    fitted, but at null nothing tells them. So each combination of their probes is tried with the
    effect's strengths at their largest probes.
    """
    own = early.model.effects[acting[-1]].parameters
    null = early.nominal(acting)[len(base.vector) :]
    others = [k for k, p in enumerate(own) if p.null is None and len(p.probes) > 1]
    strengths = [k for k, p in enumerate(own) if p.null is not None and p.probes]
    if not others or not strengths:
        return null
    places, rows = [], []
    for probes in product(*(own[k].probes for k in others)):
        place = null.copy()
        place[others] = [own[k].to_unit(np.asarray(x)) for k, x in zip(others, probes, strict=True)]
        places.append(place)
        for k in strengths:
            row = place.copy()
            row[k] = own[k].to_unit(np.asarray(max(own[k].probes, key=abs)))
            rows.append(np.concatenate([base.vector, row]))
    moved = early.residuals(acting)(np.array(rows), early.everything) - base.residual
    root = np.sqrt(base.weights)[:, None]
    slopes = (base.jacobian * root[..., None]).reshape(base.residual.size, base.jacobian.shape[2])
    target, moved = (base.residual * root).ravel(), (moved * root).reshape(len(rows), -1)
    losses = []
    for at in range(len(places)):
        own = moved[at * len(strengths) : (at + 1) * len(strengths)].T
        losses.append((without(np.hstack([slopes, own]), target) ** 2).sum())
    return places[int(np.argmin(losses))]


def without(slopes: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return what of a target (m, ...) no change of the parameters behind slopes (m, n) gives.

    Each of them is held near where it is, by one unit of its range.
    """
    ridge = np.vstack([slopes, np.eye(slopes.shape[1])])
    held = np.concatenate([target, np.zeros((slopes.shape[1], *target.shape[1:]))])
    return target - slopes @ np.linalg.lstsq(ridge, held, rcond=None)[0]


@dataclass(frozen=True)
class Library:
    """The fitted whole, and what its slopes say of the model with only a few of its effects."""

    early: Inquiry
    effects: tuple[str, ...]  # all of them
    fit: Fit  # to the beginnings
    # the same where its fits started, every effect at its null: what one effect alone would do
    # shows there, before all of them have moved
    starts: tuple["Library", ...] = ()
    # the vector with effects as guessed, where that misses less than what fits come to from null
    guess: np.ndarray | None = None

    def best(self, size: int, most: int, beside: Sequence[str] = ()) -> list[tuple[str, ...]]:
        """Return the sets of so many effects that would predict best, beside those that act.

        None of them can do all that another of them does.
        """
        others = [name for name in self.effects if name not in beside]
        return sorted(self._sets(others, size, beside), key=self.loss)[:most]

    def guessed(
        self, size: int, most: int, beside: Sequence[str]
    ) -> list[tuple[tuple[str, ...], np.ndarray]]:
        """Return the sets of so many guessed effects that do best so, and what is guessed."""
        if self.guess is None:
            return []
        known = self.early.have_guess([n for n in self.effects if n not in beside])
        sets = self._sets(known, size, beside)
        fits = [self.look(effects, self.guess[self._kept(effects)]) for effects in sets]
        pairs = sorted(zip(sets, fits, strict=True), key=lambda pair: pair[1].loss)
        return [(effects, fit.vector) for effects, fit in pairs[:most]]

    def _sets(
        self, names: Sequence[str], size: int, beside: Sequence[str]
    ) -> list[tuple[str, ...]]:
        """Return sets of so many, beside those that act, but where one holds all of another."""
        sets, nested = [*combinations(names, size)], self.early.nested(names, names)
        fine = [some for some in sets if not any({*pair} <= {*some} for pair in nested)]
        return [(*beside, *some) for some in fine or sets]

    def loss(self, effects: Sequence[str]) -> float:
        """Return the weighted square that the model with these effects alone would miss by."""
        return self._solved(effects)[2]

    def start(self, effects: Sequence[str]) -> np.ndarray:
        """Return the unit vector (n,) that the slopes promise for the model with these effects."""
        columns, step, _ = self._solved(effects)
        vector = self._null.copy()
        vector[columns] += step
        return np.clip(vector, EDGE, 1 - EDGE)[self._kept(effects)]

    def look(self, effects: Sequence[str], start: np.ndarray) -> Fit:
        """Return the beginnings as the model with these effects predicts them from a start.

        Its slopes are the library's.
        """
        residual = self.early.residuals(effects)(start[None], self.early.everything)[0]
        return Fit(start, residual, self.fit.jacobian[:, :, self._kept(effects)], self.fit.jitter)

    def again(self, effects: tuple[str, ...], part: Fit, effort: Effort) -> "Library":
        """Return the whole fitted from where the model with a few of its effects was, if better."""
        vector = self.early.carried(self.effects, effects, part.vector, self._null)
        fit = self.early.fit(self.effects, vector, effort.refit)
        if fit.loss > (1 - effort.pays) * self.fit.loss:
            return self
        return replace(
            self, fit=self.early.fit(self.effects, fit.vector, effort.library, known=fit)
        )

    def step(self, effects: Sequence[str]) -> np.ndarray:
        """Return the step from all at null to the model with these effects, free ones' first."""
        return self._solved(effects)[1]

    def predicted(self, effects: Sequence[str]) -> float:
        """Return the typical error that the slopes promise with these effects, % of the scale."""
        columns, step, _ = self._solved(effects)
        residual, slopes = self.weighted
        after = (residual + slopes[..., columns] @ step) / np.sqrt(self.fit.weights)[:, None]
        every = self.early.everything
        percent = self.early.percent(self.early.difference_of(after, every), every)[0]
        return float(np.median(percent))

    @cached_property
    def columns(self) -> dict[str, list[int]]:
        """Which of the vector's entries are whose."""
        every = list(range(len(self.fit.vector)))
        return {name: every[self.early.entries(self.effects, name)] for name in self.effects}

    @property
    def free(self) -> list[int]:
        """The base model's parameters that a fit may change."""
        return np.flatnonzero(self.early.free(self.effects)[: self._own]).tolist()

    @property
    def _own(self) -> int:
        return len(self.early.model.parameters)

    def _kept(self, effects: Sequence[str]) -> list[int]:
        """Return which of the vector's entries the model with a few of the effects has."""
        return [*range(self._own), *(k for name in effects for k in self.columns[name])]

    @cached_property
    def _null(self) -> np.ndarray:
        """The fitted vector with every strength at its null."""
        found = self.fit.vector.copy()
        for k, p in enumerate(self.early.parameters(self.effects)):
            if p.null is not None:
                found[k] = p.to_unit(np.asarray(p.null))
        return found

    @cached_property
    def weighted(self) -> tuple[np.ndarray, np.ndarray]:
        """Residuals (n_trials, D) with every effect at null, and slopes, as the fit weighs them."""
        fit, root = self.fit, np.sqrt(self.fit.weights)[:, None]
        residual = fit.residual + fit.jacobian @ (self._null - fit.vector)
        return residual * root, fit.jacobian * root[..., None]

    @cached_property
    def _normal(self) -> tuple[np.ndarray, np.ndarray, float]:
        residual, slopes = self.weighted
        residual, slopes = residual.ravel(), slopes.reshape(residual.size, slopes.shape[2])
        return slopes.T @ slopes, slopes.T @ residual, float(residual @ residual)

    def _solved(self, effects: Sequence[str]) -> tuple[list[int], np.ndarray, float]:
        """Return columns, the step from all at null, and the loss after it."""
        hold, pull, whole = self._normal
        sd = self.early.expected(self.effects)
        columns = [*self.free, *(k for name in effects for k in self.columns[name])]
        if not columns:
            return columns, np.empty(0), whole
        curvature = hold[np.ix_(columns, columns)] + np.diag(1 / sd[columns] ** 2)
        try:
            step = -np.linalg.solve(curvature, pull[columns])
        except np.linalg.LinAlgError:  # as of two effects that make one and the same run diverge
            step = -np.linalg.lstsq(curvature, pull[columns], rcond=None)[0]
        return columns, step, float(whole + pull[columns] @ step)


class Beginnings:
    """Models with a few effects, fitted to the beginnings of trials: `fits` by their effects."""

    def __init__(self, inquiry: Inquiry, floor: Floor, rule: Rule, effort: Effort) -> None:
        self.inquiry, self._floor, self._rule, self._effort = inquiry, floor, rule, effort
        self.fits: dict[tuple[str, ...], Fit] = {}

    def fit(self, effects: tuple[str, ...], start: np.ndarray, known: Fit | None = None) -> Fit:
        """Fit a model for as long as that pays, and keep the fit if it is the best one."""
        effort, fit = self._effort, known
        for _ in range(1 + effort.rounds):
            last, fit = fit, self.inquiry.fit(effects, start, effort.refit, known=fit)
            start = fit.vector
            if last is not None and fit.loss > (1 - effort.pays) * last.loss:
                break
        assert fit is not None
        before = self.fits.get(effects)
        if before is None or fit.loss < before.loss:
            self.fits[effects] = fit
        return fit

    def begun(self, effects: tuple[str, ...]) -> list[Fit]:
        """Return where a fit to whole trials starts: the best fit, and one from the nominal model.

        That has the strengths of the best one, and is not kept: it is not fitted to its end.
        """
        inquiry, best = self.inquiry, self.fits[effects]
        own = inquiry.free(())
        if not own.any():
            return [best]
        start = np.concatenate([inquiry.nominal(()), best.vector[len(own) :]])
        return [best, inquiry.fit(effects, start, self._effort.refit)]

    def best(self, size: int) -> tuple[str, ...]:
        """Return the set of so many effects that fits best."""
        return min((e for e in self.fits if len(e) == size), key=lambda e: self.fits[e].loss)

    def starts(self, effects: tuple[str, ...], vector: np.ndarray) -> list[np.ndarray]:
        """Return where a fit may start: the library's promise, and what smaller sets reached.

        A set that was left in a worse valley than one of its parts would lose to it.
        """
        parts = [e for e in self.fits if set(e) < set(effects)]
        if not parts:
            return [vector]
        part = min(parts, key=lambda e: self.fits[e].loss)
        return [vector, self.inquiry.carried(effects, part, self.fits[part].vector, vector)]

    def parts(
        self, fixed: tuple[str, ...], others: Sequence[str], size: int
    ) -> list[tuple[str, ...]]:
        """Return the sets of so many effects beside the fixed ones, all fitted.

        One that was only fitted as part of a larger set starts from the best of those.
        """
        sets = [(*fixed, *some) for some in combinations(others, size)]
        for effects in (e for e in sets if e not in self.fits):
            larger = [e for e in self.fits if set(effects) < set(e)]
            whole = min(larger, key=lambda e: self.fits[e].loss)
            self.fit(effects, self.inquiry.carried(effects, whole, self.fits[whole].vector))
        return sets

    def expected_error(self, effects: tuple[str, ...], fit: Fit | None = None) -> float:
        """Return the typical error that a fit will have on other beginnings like these."""
        inquiry, fit = self.inquiry, fit or self.fits[effects]
        low = inquiry.low_percent(inquiry.difference_of(fit.residual, inquiry.everything))
        rest = np.flatnonzero(usual([low], self._floor, self._rule))
        kept = replace(fit, residual=fit.residual[rest], jacobian=fit.jacobian[rest])
        too_small = inquiry.optimism(effects, kept, rest) / max(len(rest), 1)
        return typical(trial_losses(kept.residual) + too_small, self._floor.unit)

    def level(self, best: tuple[str, ...], other: tuple[str, ...]) -> bool:
        """Tell whether another set fits no worse than the best one but for luck."""
        return level(self.fits[best], self.fits[other], self.inquiry.groups, self._rule)


def level(best: Fit, other: Fit, groups: np.ndarray, rule: Rule) -> bool:
    """Tell whether another fit to the same trials is no worse than the best one but for luck."""
    extra = trial_losses(other.residual) - trial_losses(best.residual)
    return worse(extra, groups, rule.far) > rule.equal

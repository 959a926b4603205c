"""Fitting a model with effects as thoroughly as the base model was fitted."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robotcast.diagnosis.errors import Floor, Gain, Scales
from robotcast.diagnosis.inquiry import Inquiry, Revision, fit_base, held_out
from robotcast.diagnosis.rule import RULE, Effort
from robotcast.diagnosis.selection import Rung
from robotcast.fitting.least_squares import Fit, trial_losses
from robotcast.hidden_effects.rivals.places import Place, unit_rows

BEGUN, ENDED = 6, 2  # fits that start, and of these those that see whole trials


def judged_base(inquiry: Inquiry, effort: Effort) -> Rung:
    """Fit the model as it is, as a diagnosis does first, and judge it on held-out trials."""
    return _judged(inquiry, fit_base(inquiry, (), effort), effort)


def judged_refit(
    inquiry: Inquiry, base: Rung, effects: Sequence[str], places: Sequence[Place], effort: Effort
) -> Rung:
    """Add `effects` to a model, fit it from several starts, by elimination, and judge it.

    First to the beginnings of trials, which are not chaotic, as the base model was fitted.

    Parameters
    ----------
    places : where the effects start; the other parameters start where the model's fit ended.
    """
    rows = unit_rows(inquiry, base.revision.fit.vector, effects, places)
    active = (*base.revision.effects, *effects)
    early = inquiry.beginnings(effort.early, effort.some)
    losses = trial_losses(early.residuals(active)(rows, early.everything)).mean(axis=1)
    starts = rows[np.argsort(losses, kind="stable")[:BEGUN]]
    begun = sorted((early.fit(active, start, 3) for start in starts), key=_loss)
    best = min((inquiry.fit(active, fit.vector, 4) for fit in begun[:ENDED]), key=_loss)
    fit = inquiry.fit(active, best.vector, effort.base)
    return _judged(inquiry, Revision(active, fit), effort)


def settled(inquiry: Inquiry, rung: Rung, effort: Effort) -> Rung:
    """Return a model fitted again from as many starts as the base model, where that is better.

    The base model's own parameters had stood in for what it lacked; with it, they may belong
    elsewhere.
    """
    effects, fit = rung.revision.effects, rung.revision.fit
    again = fit_base(inquiry, effects, effort, about=fit.vector)
    return rung if again.fit.loss >= fit.loss else _judged(inquiry, again, effort)


def rematched(inquiry: Inquiry, base: Rung, rival: Rung, effort: Effort) -> Rung:
    """Return the base model fitted from a rival's parameters, where that is better.

    A refit that found a better valley of the old parameters would else count for its effect.
    """
    start = rival.revision.fit.vector[: len(base.revision.fit.vector)]
    fit = inquiry.fit(base.revision.effects, start, effort.base)
    if fit.loss >= base.revision.fit.loss:
        return base
    return _judged(inquiry, replace(base.revision, fit=fit), effort)


def saving(inquiry: Inquiry, before: Rung, after: Rung, floor: Floor) -> Gain:
    """Return what one model saves on held-out trials over another."""
    every = np.ones(len(inquiry.records), dtype=bool)
    scales = Scales(floor, 1.0, inquiry.groups, every, RULE)
    scales = replace(scales, base=scales.typical(before.errors.waypoint))
    return scales.gain(before.errors.waypoint, after.errors.waypoint)


def _loss(fit: Fit) -> float:
    return fit.loss


def _judged(inquiry: Inquiry, revision: Revision, effort: Effort) -> Rung:
    return Rung(revision, held_out(inquiry, revision, effort))

"""Whether the same effect would have come first on other trials of the same kind."""

from collections.abc import Iterable

import numpy as np

from robotcast.diagnosis.search.found import Found, Rung

RESAMPLES = 2000


def first_in_resamples(
    found: Found, refitted: Iterable[Rung], groups: np.ndarray, seed: int
) -> dict[str, float]:
    """Return the share of resamples in which each refitted effect lowers the error most.

    Whole groups of trials are drawn with replacement (the bootstrap, Efron 1979). Compared are
    the held-out errors of all models that were refitted with one further effect on top of the
    same one, so nothing is simulated; an effect that was only screened has no such error and no
    share. In some resamples no effect may lower the error: shares need not add up to 1.

    Parameters
    ----------
    refitted : every rung that was judged on the way, also those that a later round replaced.
    groups : ndarray of shape (n_trials,), the group of every trial, numbered from 0.
    """
    n = int(groups.max()) + 1
    drawn = np.random.default_rng(seed).multinomial(n, np.full(n, 1 / n), size=RESAMPLES)
    errors = {frozenset(rung.revision.effects): rung.errors.waypoint for rung in refitted}
    errors |= {frozenset(rung.revision.effects): rung.errors.waypoint for rung in found.ladder}
    shares = {}
    for name, before in _added(found).items():
        if before not in errors:
            continue
        gains = {
            effects: drawn @ _mean_of_groups(np.sqrt(errors[before]) - np.sqrt(after), groups)
            for effects, after in errors.items()
            if before < effects and len(effects) == len(before) + 1
        }
        own = gains[before | {name}]
        first = (own == np.max(list(gains.values()), axis=0)) & (own > 0)
        shares[name] = float(first.mean())
    return shares


def _added(found: Found) -> dict[str, frozenset[str]]:
    """Return refitted effect → the effects that acted before it was added."""
    added = {name: frozenset(r.revision.effects) - {name} for name, r in found.refits.items()}
    for before, after in zip(found.ladder, found.ladder[1:], strict=False):
        new = set(after.revision.effects) - set(before.revision.effects)
        if len(new) == 1:
            added[new.pop()] = frozenset(before.revision.effects)
    return added


def _mean_of_groups(values: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Return the mean of trials' values (n_trials,) in every group, (n_groups,)."""
    return np.bincount(groups, values) / np.bincount(groups)

"""Splitting a set in two so that neither side has seen an action of the other."""

import numpy as np

from robotcast.measurements.measurement_set import MeasurementSet


def split_by_action(
    measured: MeasurementSet, n_first: int, n_second: int, seed: int
) -> tuple[MeasurementSet, MeasurementSet]:
    """Draw two disjoint sets of `n_first` and `n_second` casts.

    All repeats of an action go to one side or are left out together. Actions with many repeats
    are placed first, each by chance in proportion to the room that is left; a side stays below
    its number only where no placing of the repeats fills it.

    Raises
    ------
    ValueError
        When the set has too few casts.
    """
    if n_first < 1 or n_second < 1:
        raise ValueError(f"both sides of a split need casts, asked for {n_first} and {n_second}")
    n_left_out = len(measured.trials) - n_first - n_second
    if n_left_out < 0:
        raise ValueError(
            f"the split needs {n_first} + {n_second} casts, the set has {len(measured.trials)}"
        )
    repeats: dict[int, list[int]] = {}
    for trial in sorted(measured.trials, key=lambda t: t.trial):
        repeats.setdefault(trial.action_id, []).append(trial.trial)
    rng = np.random.default_rng(seed)
    drawn = rng.permutation(sorted(repeats)).tolist()
    sides: list[list[int]] = [[], [], []]
    room = np.array([n_first, n_second, n_left_out])
    for action_id in sorted(drawn, key=lambda drawn_id: -len(repeats[drawn_id])):
        casts = repeats[action_id]
        fits = np.where(room >= len(casts), room, 0)
        if fits.any():
            side = int(rng.choice(3, p=fits / fits.sum()))
            sides[side].extend(casts)
            room[side] -= len(casts)
    first, second, _ = sides
    if not first or not second:
        most = max(len(casts) for casts in repeats.values())
        raise ValueError(
            f"no split into {n_first} + {n_second} casts keeps the repeats of an action "
            f"together; the set has {len(repeats)} actions with up to {most} casts"
        )
    return measured.select(first), measured.select(second)

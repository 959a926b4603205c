"""How far a hidden effect moves the paths, and the size that moves them as far as wanted."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import repeat

import numpy as np

from robotcast.casts.plan import PlannedCast
from robotcast.hidden_effects.case import Case
from robotcast.hidden_effects.mechanisms import MECHANISMS, Parameters
from robotcast.rigs.virtual.rig import SLOWEST_S, VirtualRig, seen_places

NEAR = 0.1  # a shift within 10 % of the wanted one will do
TRIALS = 4
LEAST_STEP, MOST_STEP = 0.2, 4.0


@dataclass(frozen=True)
class SeenCasts:
    """Where the camera would see the free end in some casts, without noise.

    Attributes
    ----------
    places_m : ndarray of shape (n_casts, k, 2); an end that rests stays.
    moving : ndarray of shape (n_casts, k) of bool, False once the cable rests.
    """

    places_m: np.ndarray
    moving: np.ndarray


def see_casts(
    rig: VirtualRig, casts: Sequence[PlannedCast], period_s: float, pool: Executor
) -> SeenCasts:
    """Simulate casts 0 … n − 1 of the rig with its chance, seen every `period_s`."""
    longest_s = max(planned.end_s for planned in casts) + SLOWEST_S
    stamps = np.arange(round(longest_s / period_s) + 1) * period_s
    seen = list(pool.map(_see, repeat(rig), casts, range(len(casts)), repeat(stamps)))
    rests_s = np.array([rest_s for _, rest_s in seen])
    return SeenCasts(np.stack([places for places, _ in seen]), stamps <= rests_s[:, None])


def shift_percent(one: SeenCasts, other: SeenCasts, length_m: float) -> float:
    """Return how far apart the ends are, averaged over a cast, in % of cable length.

    The median over casts: a cast that amplifies everything does not count for more.
    """
    apart = np.linalg.norm(one.places_m - other.places_m, axis=2)
    moving = one.moving | other.moving
    averages = (apart * moving).sum(axis=1) / moving.sum(axis=1)
    return float(100 * np.median(averages) / length_m)


def fit_parameters(
    case: Case,
    nominal: VirtualRig,
    casts: Sequence[PlannedCast],
    period_s: float,
    pool: Executor,
) -> tuple[dict[str, Parameters], dict[str, float]]:
    """Find the size of everything hidden in a case, one mechanism at a time.

    Returns
    -------
    parameters : mechanism → its parameters.
    shifts : mechanism → how far it alone moves the paths [% of cable length]; below
        `case.wanted_percent` where its largest size moves them no farther.
    """
    length = nominal.cable.length_m
    without = see_casts(case.rig(nominal, {}), casts, period_s, pool)

    def moved(name: str, given: Parameters) -> float:
        seen = see_casts(case.rig(nominal, {name: given}), casts, period_s, pool)
        return shift_percent(seen, without, length)

    parameters, shifts = {}, {}
    for name, place in case.hidden.items():
        parameters[name], shifts[name] = _fit_size(name, place, case.wanted_percent, moved)
    return parameters, shifts


def _fit_size(
    name: str,
    place: Mapping[str, float],
    wanted_percent: float,
    moved: Callable[[str, Parameters], float],
) -> tuple[Parameters, float]:
    """Return parameters and shift of the size whose shift came nearest to the wanted one."""
    mechanism = MECHANISMS[name]
    size, tried = mechanism.start, []
    for _ in range(TRIALS):
        given = mechanism.parameters(place, size)
        shift = max(moved(name, given), 1e-9)
        miss = abs(np.log(shift / wanted_percent))
        tried.append((miss, given, shift))
        step = float(np.clip(wanted_percent / shift, LEAST_STEP, MOST_STEP))
        following = min(size * step, mechanism.most)
        if miss < np.log1p(NEAR) or following == size:
            break
        size = following
    _, given, shift = min(tried, key=lambda one: one[0])
    return given, shift


def _see(
    rig: VirtualRig, planned: PlannedCast, number: int, stamps: np.ndarray
) -> tuple[np.ndarray, float]:
    cable = rig.simulate_truth(planned, number).cable
    return seen_places(rig, cable, stamps), float(cable.t_s[-1])

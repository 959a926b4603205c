"""Effects that came near to being named, which further trials may confirm."""

import numpy as np

from robotcast.diagnosis.search.floor import Floor
from robotcast.diagnosis.search.found import Found, Rung
from robotcast.diagnosis.search.gain import worse
from robotcast.diagnosis.search.rounds import EQUAL


def came_near(found: Found, groups: np.ndarray, floor: Floor) -> tuple[Rung, ...]:
    """Return the refits beside the last model that promise to pay, the best first.

    Those that are clearly worse than the best one are left out: what is returned are the effects
    that the trials can neither confirm nor tell apart.

    Parameters
    ----------
    groups : of the trials, (n_trials,).
    """
    if not found.ladder:
        return ()
    top = found.ladder[-1].revision.effects
    tried = [rung for rung in found.refits.values() if rung.revision.effects[:-1] == top]
    hopeful = [rung for rung in tried if rung.gain and rung.gain.promises]
    misses = [floor.misses(rung.errors.waypoint) for rung in hopeful]
    order = sorted(range(len(hopeful)), key=lambda k: float(misses[k].mean()))
    return tuple(
        hopeful[k]
        for k in order
        if k == order[0] or worse(misses[k] - misses[order[0]], groups) > EQUAL
    )

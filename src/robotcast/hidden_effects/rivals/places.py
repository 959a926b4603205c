"""Values of an effect's parameters at which it is tried."""

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.model import Candidate
from robotcast.fitting.parameter import Parameter

INSIDE = 1e-3  # a fit that starts on a bound stalls: starts keep this share of the range from it

Place = Mapping[str, Mapping[str, float]]
"""Effect → parameter → value, of some parameters; the others stand at their nominal value, which
of a strength is its null."""


def all_probes(candidate: Candidate) -> list[Place]:
    """Return every combination of null and probes; null once, not once for every place."""
    strengths = [p for p in candidate.parameters if p.null is not None and not p.frozen]
    combined = product(*((p.nominal, *p.probes) for p in strengths))
    tried = [dict(zip((p.name for p in strengths), values, strict=True)) for values in combined]
    nothing, *something = tried
    places = [where | strength for where in _wheres(candidate) for strength in something]
    return [{candidate.name: one} for one in (nothing, *places)]


def least_strengths(candidate: Candidate) -> list[Place]:
    """Return, at every place to try, each strength alone at its probe nearest to null."""
    strengths = [p for p in candidate.parameters if p.null is not None and p.probes]
    return [
        {candidate.name: where | {p.name: _nearest_to_null(p)}}
        for where in _wheres(candidate)
        for p in strengths
    ]


def joined(places: Sequence[Sequence[Place]]) -> list[Place]:
    """Combine the places of several effects, every one with every other."""
    return [
        {name: own for place in some for name, own in place.items()} for some in product(*places)
    ]


def unit_rows(
    inquiry: Inquiry, base: np.ndarray, effects: Sequence[str], places: Sequence[Place]
) -> np.ndarray:
    """Return unit vectors (n_places, n): the base parameters' `base`, then the effects' values."""
    own = [(name, p) for name in effects for p in inquiry.model.effects[name].parameters]
    values = [
        [_unit(p, place.get(name, {}).get(p.name, p.nominal)) for name, p in own]
        for place in places
    ]
    return np.hstack([np.tile(base, (len(places), 1)), np.array(values)])


def _wheres(candidate: Candidate) -> list[dict[str, float]]:
    """Return values of the parameters that are no strengths, every combination of probes."""
    others = [p for p in candidate.parameters if p.null is None and not p.frozen]
    values = product(*(p.probes or (p.nominal,) for p in others))
    return [dict(zip((p.name for p in others), one, strict=True)) for one in values]


def _nearest_to_null(parameter: Parameter) -> float:
    return min(parameter.probes, key=lambda probe: abs(probe - parameter.nominal))


def _unit(parameter: Parameter, value: float) -> float:
    return float(np.clip(parameter.to_unit(np.asarray(value)), INSIDE, 1 - INSIDE))

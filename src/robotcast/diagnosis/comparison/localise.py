"""Where the error sits: the few slices that hold most of it, none of them by chance."""

from collections.abc import Sequence

import numpy as np

from robotcast.diagnosis.comparison.candidate_slices import candidate_slices
from robotcast.diagnosis.comparison.finding import Finding, find, well_beyond
from robotcast.diagnosis.comparison.misfit import Misfit
from robotcast.diagnosis.comparison.slice_contrast import Contrast
from robotcast.diagnosis.model import Record
from robotcast.diagnosis.rule import RULE, Slicing
from robotcast.diagnosis.wording import Wording


def localise(
    records: Sequence[Record],
    found: Misfit,
    noise: np.ndarray | None,
    exceptions: Sequence[Finding],
    wording: Wording,
    rng: np.random.Generator,
    slicing: Slicing = RULE.slicing,
) -> list[Finding]:
    """Find the slices that hold most of the squared error, the weightiest first.

    Slices are taken one after another. Each must hold well more of the error than of the
    samples, also of that part of it which exceeds noise, and stand out when whole trials are
    permuted (see `Contrast`). What a chosen slice explains is taken out before the next is
    looked for, so that no two say the same.

    Parameters
    ----------
    noise : ndarray of shape (n_trials, k_max), the squared error that noise alone makes at every
        sample; None when it is not known.
    exceptions : findings on single trials, which come first; their trials are left out here.
    """
    findings = list(exceptions)
    used = found.present.copy()
    for finding in findings:
        used &= ~finding.slice.mask
    square = found.distance**2
    excess = square if noise is None else square - noise
    if excess[used].sum() < slicing.excess * square[used].sum():
        return findings
    candidates = candidate_slices(records, wording, slicing)
    if not candidates:
        return findings
    contrast = Contrast(candidates, found, used, rng)
    remaining = square
    while len(findings) < slicing.most:
        weight, p_value = contrast.test(remaining)
        eligible = [
            at
            for at in np.flatnonzero(p_value <= slicing.level).tolist()
            if candidates[at].kind not in {f.slice.kind for f in findings}
            and well_beyond(*contrast.shares(at, square), slicing)
            and well_beyond(*contrast.shares(at, excess), slicing)
        ]
        if not eligible:
            break
        best = max(eligible, key=lambda at: weight[at])
        shares = contrast.shares(best, square)
        p = float(p_value[best])
        findings.append(find(candidates[best], shares, found, used, p, wording, slicing))
        remaining = contrast.without(best, remaining)
    return findings

"""Single trials whose error is out of all proportion to the others'."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robotcast.diagnosis.comparison.finding import Finding, find, well_beyond
from robotcast.diagnosis.comparison.misfit import Misfit
from robotcast.diagnosis.comparison.slice_sentence import outstanding_sentence
from robotcast.diagnosis.comparison.slices import Slice
from robotcast.diagnosis.model import Record
from robotcast.diagnosis.rule import RULE, Slicing
from robotcast.diagnosis.wording import Wording


def outstanding_trials(
    records: Sequence[Record],
    found: Misfit,
    wording: Wording,
    slicing: Slicing = RULE.slicing,
) -> list[Finding]:
    """Return one finding on the few trials that hold much of the error alone, or none."""
    square = np.where(found.present, found.distance**2, 0)
    size = np.sqrt(square.sum(axis=1) / found.present.sum(axis=1))
    usual = np.quantile(size, 0.9, method="lower")
    rows = np.flatnonzero(size > slicing.outstanding * usual)
    if len(records) <= slicing.fewest or not len(rows):
        return []
    rows = rows[np.argsort(-size[rows], kind="stable")]
    shares = (
        float(square[rows].sum() / square.sum()),
        float(found.present[rows].sum() / found.present.sum()),
    )
    if not well_beyond(*shares, slicing):
        return []
    made = _slice_of(rows, records, found.present, wording)
    sentence = outstanding_sentence(made.name, len(rows), shares[0], len(records), wording)
    finding = find(made, shares, found, found.present, None, wording, slicing)
    return [replace(finding, sentence=sentence)]


def _slice_of(
    rows: np.ndarray, records: Sequence[Record], present: np.ndarray, wording: Wording
) -> Slice:
    mask = np.zeros_like(present)
    mask[rows] = present[rows]
    *first, last = (str(records[row].trial) for row in rows)
    numbers = f"{', '.join(first)} and {last}" if first else last
    name = f"{wording.trial if len(rows) == 1 else wording.trials} {numbers}"
    return Slice(
        name=name,
        kind="trial",
        subject=name.capitalize(),
        trials=tuple(r.trial for r in records),
        mask=mask,
        whole_trials=True,
    )

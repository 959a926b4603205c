"""Which part of the base model's error every refitted effect takes away."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from robotcast.diagnosis.compare import Comparison, compare
from robotcast.diagnosis.found import Found
from robotcast.diagnosis.inquiry import Inquiry, Revision
from robotcast.diagnosis.misfit import padded
from robotcast.diagnosis.rule import Rule
from robotcast.diagnosis.slices import Slice, slice_errors
from robotcast.diagnosis.wording import Wording


class Explained:
    """Predictions of fitted revisions beside the trials; each revision is simulated once."""

    def __init__(self, inquiry: Inquiry, wording: Wording, rule: Rule) -> None:
        self._inquiry, self._wording, self._rule = inquiry, wording, rule
        self._predicted: dict[tuple[tuple[str, ...], bytes], np.ndarray] = {}
        self._compared: dict[tuple[tuple[str, ...], bytes], Comparison] = {}

    def comparison(self, revision: Revision) -> Comparison:
        """Compare a revision with all trials; diverged runs stay diverged."""
        key = (revision.effects, revision.fit.vector.tobytes())
        if key not in self._compared:
            model = self._inquiry.model
            self._compared[key] = compare(
                self._inquiry.records,
                self._prediction(revision),
                scale=model.scale,
                error_unit=model.error_unit,
                wording=self._wording,
                rule=self._rule,
            )
        return self._compared[key]

    def slices(self, found: Found) -> dict[str, list[dict[str, Any]]]:
        """Return for every refitted effect the base model's slices before and after it."""
        pairs = _before_and_after(found)
        if not pairs:
            return {}
        slices = _usual_slices(self.comparison(found.base.revision))
        return {
            name: [
                {"slice": some.name, "before_percent": b, "after_percent": a}
                for some, b, a in zip(
                    slices, self._errors(slices, before), self._errors(slices, after), strict=True
                )
            ]
            for name, (before, after) in pairs.items()
        }

    def _errors(self, slices: Sequence[Slice], revision: Revision) -> list[float | None]:
        inquiry = self._inquiry
        predicted = self._prediction(revision)
        return slice_errors(slices, inquiry.records, predicted, inquiry.model.scale)

    def _prediction(self, revision: Revision) -> np.ndarray:
        """Return what a revision predicts, (n_trials, k_max, d)."""
        key = (revision.effects, revision.fit.vector.tobytes())
        if key not in self._predicted:
            inquiry, vector = self._inquiry, revision.fit.vector[None]
            difference = inquiry.differences(revision.effects, vector, inquiry.everything)[0]
            measured = padded(inquiry.records, [r.measured for r in inquiry.records])
            self._predicted[key] = measured + difference
        return self._predicted[key]


def _usual_slices(base: Comparison) -> list[Slice]:
    """Return the slices that hold most of the error, without trials named for their size."""
    single = [f.slice.mask for f in base.findings if f.slice.kind == "trial"]
    usual = ~np.any([*single, np.zeros_like(base.found.present)], axis=0)
    return [
        replace(f.slice, mask=f.slice.mask & usual)
        for f in base.findings
        if f.slice.kind != "trial"
    ]


def _before_and_after(found: Found) -> dict[str, tuple[Revision, Revision]]:
    """Return every judged effect's revisions without it and with it.

    Effects that are judged together only share the pair.
    """
    pairs: dict[str, tuple[Revision, Revision]] = {}
    if not found.judged:
        return pairs
    models = {frozenset(e): rung.revision for e, rung in found.judged.items()}
    base = found.base.revision
    for effects, rung in sorted(found.judged.items(), key=lambda item: item[0] == found.chosen):
        for name in effects[len(base.effects) :]:
            without = models.get(frozenset(effects) - {name}, base)
            pairs[name] = (without, rung.revision)
    return pairs

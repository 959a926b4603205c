"""Let other methods name what the sets of the hidden-effect benchmark hide.

A random guess, the largest raw sensitivity and, on `hidden_effects.brute_force` cases, refits of
every effect in turn read a set alone. Once they have spoken, the oracle opens its answer and fits
the model with what is hidden, which is what any diagnosis could reach at best; cases that hide
nothing, or something that the library has no name for, have none. All start from one fit of the
model as it is. What stands is not done again.
"""

import json
import time
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import DictConfig

from robotcast.diagnosis.diagnose import floor_and_noise
from robotcast.diagnosis.errors import Floor, Gain, Scales
from robotcast.diagnosis.found import Rung
from robotcast.diagnosis.inquiry import Inquiry, Revision, fit_base, held_out
from robotcast.diagnosis.model import Candidate
from robotcast.diagnosis.rule import RULE, Effort, Rule
from robotcast.diagnosis.sizes import sizes
from robotcast.files import unseal, write_text
from robotcast.fitting.least_squares import trial_losses
from robotcast.measurements.reader import read_measurement_set
from robotcast.running import Progress
from robotcast.stage import bar, stage, tell
from robotcast.workflow.diagnosing import case_of
from studies.hidden_effects.cases import answer_path
from studies.hidden_effects.layout import measured_sets, result

by_loss = attrgetter("loss")
INSIDE = 1e-3  # a fit that starts on a bound stalls: starts keep this share of the range from it
BEGUN, ENDED = 6, 2  # fits that start, and of these those that see whole trials

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
    least = [(p.name, min(p.probes, key=lambda probe: abs(probe - p.nominal))) for p in strengths]
    wheres = _wheres(candidate)
    return [{candidate.name: where | {name: value}} for where in wheres for name, value in least]


def _wheres(candidate: Candidate) -> list[dict[str, float]]:
    """Return values of the parameters that are no strengths, every combination of probes."""
    others = [p for p in candidate.parameters if p.null is None and not p.frozen]
    values = product(*(p.probes or (p.nominal,) for p in others))
    return [dict(zip((p.name for p in others), one, strict=True)) for one in values]


def unit_rows(
    inquiry: Inquiry, base: np.ndarray, effects: Sequence[str], places: Sequence[Place]
) -> np.ndarray:
    """Return unit vectors (n_places, n): the base parameters' `base`, then the effects' values."""
    own = [(name, p) for name in effects for p in inquiry.model.effects[name].parameters]
    values = np.array(
        [
            [p.to_unit(np.asarray(place.get(name, {}).get(p.name, p.nominal))) for name, p in own]
            for place in places
        ]
    )
    return np.hstack([np.tile(base, (len(places), 1)), np.clip(values, INSIDE, 1 - INSIDE)])


@dataclass(frozen=True)
class Question:
    """A model beside a set, and fits as thorough as the diagnosis's of its base model."""

    inquiry: Inquiry
    candidates: Sequence[str]  # names of the effects to try
    floor: Floor
    rule: Rule
    effort: Effort

    def base(self) -> Rung:
        """Fit the model as it is, as a diagnosis does first, and judge it on held-out trials."""
        return self._judged(fit_base(self.inquiry, (), self.effort))

    def refitted(self, base: Rung, effects: Sequence[str], places: Sequence[Place]) -> Rung:
        """Add `effects` to a model, fit it from several starts, by elimination, and judge it.

        First to the beginnings of trials, which are not chaotic, as the base model was fitted. The
        effects start at `places`, the other parameters where the model's fit ended.
        """
        inquiry, effort = self.inquiry, self.effort
        rows = unit_rows(inquiry, base.revision.fit.vector, effects, places)
        active = (*base.revision.effects, *effects)
        early = inquiry.beginnings(effort.early, effort.some)
        losses = trial_losses(early.residuals(active)(rows, early.everything)).mean(axis=1)
        starts = rows[np.argsort(losses, kind="stable")[:BEGUN]]
        begun = sorted((early.fit(active, start, 3) for start in starts), key=by_loss)
        best = min((inquiry.fit(active, fit.vector, 4) for fit in begun[:ENDED]), key=by_loss)
        return self._judged(Revision(active, inquiry.fit(active, best.vector, effort.base)))

    def settled(self, rung: Rung) -> Rung:
        """Return a model fitted again from as many starts as the base model, where it is better.

        The base model's own parameters had stood in for what it lacked; with it, they may be
        others.
        """
        fit = rung.revision.fit
        again = fit_base(self.inquiry, rung.revision.effects, self.effort, about=fit.vector)
        return rung if again.fit.loss >= fit.loss else self._judged(again)

    def rematched(self, base: Rung, rival: Rung) -> Rung:
        """Return the base model fitted from a rival's parameters, where that is better.

        A refit that found a better valley of the old parameters would else count for its effect.
        """
        start = rival.revision.fit.vector[: len(base.revision.fit.vector)]
        fit = self.inquiry.fit(base.revision.effects, start, self.effort.base)
        if fit.loss >= base.revision.fit.loss:
            return base
        return self._judged(replace(base.revision, fit=fit))

    def saving(self, before: Rung, after: Rung) -> Gain:
        """Return what one model saves on held-out trials over another."""
        every = np.ones(len(self.inquiry.records), dtype=bool)
        scales = Scales(self.floor, 1.0, self.inquiry.groups, every, RULE)
        scales = replace(scales, base=scales.typical(before.errors.waypoint))
        return scales.gain(before.errors.waypoint, after.errors.waypoint)

    def _judged(self, revision: Revision) -> Rung:
        return Rung(revision, held_out(self.inquiry, revision, self.effort))


def random_guess(case: str, candidates: Sequence[str], seed: int) -> str:
    """Return one of the candidates, each as likely; the same for the same case and seed."""
    random = np.random.default_rng([seed, zlib.crc32(case.encode())])
    return sorted(candidates)[random.integers(len(candidates))]


def raw_sensitivities(question: Question, base: Revision) -> dict[str, float]:
    """Return how far each effect at its smallest probe moves the predictions.

    The root mean square over trials in units of the noise; of an effect with several strengths
    or places to try, the largest. No residual is asked and nothing tested: this is what a
    sensitivity ranking alone can say.
    """
    inquiry, moves = question.inquiry, {}
    for name in question.candidates:
        places = least_strengths(inquiry.model.effects[name])
        rows = unit_rows(inquiry, base.fit.vector, [name], places)
        residuals = inquiry.residuals((*base.effects, name))(rows, inquiry.everything)
        moved = residuals - base.fit.residual
        moves[name] = float(np.sqrt((moved**2).sum(axis=2).mean(axis=1)).max())
    return moves


@dataclass(frozen=True)
class Round:
    """Every effect tried on top of a model."""

    best: str  # the one with the smallest held-out error
    p_value: float  # of its saving
    tried: Mapping[str, float]  # effect → its held-out waypoint error, % of the scale
    kept: Rung  # the model that goes on: with the best one if it pays, without it if not
    simulated_casts: int  # that the round took

    @property
    def paid(self) -> bool:
        """Whether the best effect was kept."""
        return self.best in self.kept.revision.effects


def brute_force(question: Question, base: Rung, note: Callable[[str], object]) -> Iterator[Round]:
    """Fit every candidate with all parameters from several starts; keep the best if it pays.

    So it goes on, round by round, as a diagnosis does: until nothing pays, nothing is left to
    explain, or there are as many effects as a diagnosis names at most. `note` is called with the
    name of each effect before it is fitted.
    """
    inquiry, top = question.inquiry, base
    for _ in range(question.rule.most_effects):
        before, rungs = inquiry.simulated, dict[str, Rung]()
        for name in question.candidates:
            if name not in top.revision.effects:
                note(name)
                places = all_probes(inquiry.model.effects[name])
                rungs[name] = question.refitted(top, [name], places)
        tried = {name: float(rung.errors.waypoint.mean()) for name, rung in rungs.items()}
        best = min(tried, key=tried.__getitem__)
        rung = question.settled(rungs[best])
        top = question.rematched(top, rung)
        saved = question.saving(top, rung)
        top = rung if saved.pays(question.rule, len(rungs)) else top
        tried_all = Round(best, saved.p_value, tried, top, inquiry.simulated - before)
        yield tried_all
        if not tried_all.paid or not question.floor.above(top.errors.waypoint, 1.0):
            return


def oracle(question: Question, base: Rung, hidden: Place) -> tuple[Rung, Rung, Gain]:
    """Fit the model with the hidden effects; return base, that model and what it saves.

    Their true parameters are one of the starts; null and the probes are others.
    """
    probes = [all_probes(question.inquiry.model.effects[name]) for name in hidden]
    places = [{k: v for place in some for k, v in place.items()} for some in product(*probes)]
    rung = question.settled(question.refitted(base, list(hidden), [hidden, *places]))
    base = question.rematched(base, rung)
    return base, rung, question.saving(base, rung)


def rivals(config: DictConfig) -> None:
    settings = config.hidden_effects
    sets = measured_sets(Path(settings.folder), settings.cases)
    with bar("rivals") as progress:
        for at, measurements in enumerate(sets):

            def noted(done: int, total: int, note: str = "", at: int = at) -> None:
                progress(at, len(sets), f"{sets[at].name}: {note or f'{done} casts'}")

            _ask(config, measurements, noted)
        progress(len(sets), len(sets))
    tell(f"{settings.reports}: {len(sets)} sets")


def _ask(config: DictConfig, measurements: Path, progress: Progress) -> None:
    """Let every method speak that has not; the answer is opened after those that guess."""
    case, settings = measurements.name, config.hidden_effects
    reports, forced = Path(settings.reports), case in settings.brute_force
    guesses, told = (result(kind, case, reports) for kind in ("rivals", "oracle"))
    spoken = guesses.exists() and not (
        forced and json.loads(guesses.read_text(encoding="utf-8"))["brute_force"] is None
    )
    if spoken and told.exists():
        return
    asked = case_of(config, read_measurement_set(measurements))
    floor, noise = floor_and_noise(asked)
    inquiry = Inquiry(asked.model, asked.records, noise, progress)
    question = Question(inquiry, tuple(asked.candidates), floor, asked.rule, asked.effort)
    base = question.base()
    fitted = inquiry.simulated
    if not spoken:
        moved = raw_sensitivities(question, base.revision)
        said = {
            "random": random_guess(case, question.candidates, config.seed),
            "largest_sensitivity": max(moved, key=moved.__getitem__),
            "moved_noise": moved,
            "brute_force": _forced(question, base, fitted, progress) if forced else None,
        }
        write_text(guesses, json.dumps(said, indent=1))
    answer = unseal(answer_path(case, reports))
    known = answer["drawn"]["kind"] in ("single", "pair")
    hidden = {one["effect"]: one["parameters"] for one in answer["effects"]}
    found = _told(question, base, fitted, hidden) if known else None
    write_text(told, json.dumps(found, indent=1))


def _forced(question: Question, base: Rung, base_casts: int, progress: Progress) -> dict[str, Any]:
    inquiry, started = question.inquiry, time.monotonic()

    def note(name: str) -> None:
        progress(inquiry.simulated, 0, f"refitting with {name}")

    rounds = list(brute_force(question, base, note))
    kept = rounds[-1].kept
    return {
        "effects": list(kept.revision.effects) or ["none"],
        "heldout_waypoint_error_percent": float(kept.errors.waypoint.mean()),
        "rounds": [
            {name: getattr(one, name) for name in ("best", "p_value", "tried", "simulated_casts")}
            for one in rounds
        ],
        "simulated_casts": base_casts + sum(one.simulated_casts for one in rounds),
        "seconds": round(time.monotonic() - started, 1),
    }


def _told(question: Question, base: Rung, base_casts: int, hidden: Place) -> dict[str, Any]:
    inquiry, before = question.inquiry, question.inquiry.simulated
    base, rung, gain = oracle(question, base, hidden)
    found = sizes(inquiry, rung.revision, rung.errors.vectors, question.rule.discrepancy)
    every, model, effects = iter(found), inquiry.model, rung.revision.effects
    counts = [len(own.parameters) for own in (model, *(model.effects[n] for n in effects))]
    base_sizes, *own = (
        {size.parameter.name: size.as_dict() for size in islice(every, count)} for count in counts
    )
    return {
        "effects": list(hidden),
        "base_heldout_waypoint_error_percent": float(base.errors.waypoint.mean()),
        "heldout_waypoint_error_percent": float(rung.errors.waypoint.mean()),
        "p_value": gain.p_value,
        "base": {"parameters": base_sizes},
        "sizes": [{"effect": n, "parameters": p} for n, p in zip(effects, own, strict=True)],
        "simulated_casts": base_casts + inquiry.simulated - before,
    }


if __name__ == "__main__":
    stage(rivals)()

"""What further trials should decide: which of two effects, or whether one is there at all."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from robotcast.diagnosis.decision import Verdict
from robotcast.diagnosis.found import Found
from robotcast.diagnosis.inquiry import Inquiry, Revision
from robotcast.diagnosis.model import Model, Record
from robotcast.diagnosis.rule import Rule
from robotcast.diagnosis.screen import Screened

CHOSEN = 8
LOOKED_INTO = 60  # candidates whose predictions differ most; of these the slopes are simulated


@dataclass(frozen=True)
class Further:
    """Trials that could be run."""

    model: Model  # predicts them, with the parameters and effects of the diagnosed model
    records: tuple[Record, ...]  # of their `measured` only the shape counts


@dataclass(frozen=True)
class Contest:
    """Two models that new trials shall tell apart."""

    # what they stand for, as reported; one name where the question is whether it is there
    names: tuple[str, ...]
    first: Revision  # a fitted model
    second: tuple[tuple[str, ...], np.ndarray]  # the other one, its effects with a unit vector (n,)
    # the second's fit, None when it is only supposed: then only the first is refitted to new trials
    rival: Revision | None = None


@dataclass(frozen=True)
class NextTrial:
    """A trial worth running."""

    record: Record
    contest: Contest  # what it helps to decide most
    difference_percent: float  # average distance of the two predictions, % of the scale


def next_trials(
    inquiry: Inquiry,
    contests: Sequence[Contest],
    further: Further,
    decides: float,
) -> list[NextTrial]:
    """Choose the trials that separate the models of all contests, the most telling first.

    One after another is taken, each time the one that helps the contest which is decided least;
    contests that no such choice could decide are left aside: two models must differ by `decides`,
    squared noise, on the chosen trials together.
    """
    if not contests or not further.records:
        return []
    bench = _Bench(inquiry, further)
    apart = np.array([bench.apart(contest) for contest in contests])
    usable = np.isfinite(apart).all(axis=0)
    if not usable.any():
        return []
    # every contest counts by its own largest difference
    shares = np.where(usable, apart / np.maximum(np.nanmax(apart, axis=1), 1e-300)[:, None], -1)
    rows = np.argsort(-shares.max(axis=0), kind="stable")[: min(LOOKED_INTO, int(usable.sum()))]
    evidence = [_Evidence(inquiry, bench, contest, rows) for contest in contests]
    known = np.all([e.known for e in evidence], axis=0)
    open_ones = [k for k, e in enumerate(evidence) if e.value(e.best(known)) > decides]
    if not open_ones:
        return []
    chosen: list[NextTrial] = []
    taken: list[int] = []
    for _ in range(min(CHOSEN, int(known.sum()))):
        least = min(open_ones, key=lambda k: evidence[k].value(taken))
        taken.append(evidence[least].next_best(known, taken))
        row = int(rows[taken[-1]])
        percent = 100 * float(apart[least, row]) / inquiry.model.scale
        chosen.append(NextTrial(further.records[row], contests[least], percent))
    return chosen


class _Bench:
    """Predicts the candidates, as residuals are weighed: in noise, every trial a mean square."""

    def __init__(self, inquiry: Inquiry, further: Further) -> None:
        self._inquiry, self._further = inquiry, further
        self.counts = np.array([len(r.times_s) for r in further.records])
        self.rows = np.arange(len(self.counts))
        self._slopes: dict[tuple[tuple[str, ...], bytes], tuple[np.ndarray, np.ndarray]] = {}

    def predictions(
        self, effects: Sequence[str], vectors: np.ndarray, rows: np.ndarray
    ) -> np.ndarray:
        """Return (n_vectors, m, k, d); 0 past a trial's samples, NaN where a run diverged."""
        inquiry = self._inquiry
        records = [self._further.records[row] for row in rows]
        found = self._further.model.predict(records, effects, inquiry.values(effects, vectors))
        inquiry.runs.add(len(vectors) * len(rows))
        counts = self.counts[rows]
        weighed = found / (np.sqrt(counts) * inquiry.noise)[:, None, None]
        weighed[:, np.arange(found.shape[2]) >= counts[:, None]] = 0
        return weighed

    def slopes(self, revision: Revision, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a revision's prediction (m, D) and its slopes (m, D, n) by its unit vector."""
        effects, vector = revision.effects, revision.fit.vector
        key = (effects, vector.tobytes() + rows.tobytes())
        if key not in self._slopes:
            steps = self._inquiry.steps(effects)
            signed = np.where(vector > 0.5, -steps, steps)
            vectors = np.vstack([vector, vector + np.diag(signed)])
            values = _flat(self.predictions(effects, vectors, rows))
            slopes = (values[1:] - values[0]) / signed[:, None, None]
            self._slopes[key] = values[0], np.moveaxis(slopes, 0, -1)
        return self._slopes[key]

    def apart(self, contest: Contest) -> np.ndarray:
        """Return the average distance of both predictions of every candidate, (n_candidates,)."""
        first, (effects, vector) = contest.first, contest.second
        here = self.predictions(first.effects, first.fit.vector[None], self.rows)[0]
        there = self.predictions(effects, vector[None], self.rows)[0]
        distance = np.linalg.norm(here - there, axis=-1).sum(axis=1)
        return distance / np.sqrt(self.counts) * self._inquiry.noise


def _flat(predictions: np.ndarray) -> np.ndarray:
    return predictions.reshape(*predictions.shape[:2], -1)


class _Evidence:
    """What trials tell of one contest, in units of noise.

    `value` of some candidates is the least weighted square by which the two models differ on
    them when both may change their parameters, each change weighed by what the trials so far
    say against it.
    """

    def __init__(self, inquiry: Inquiry, bench: _Bench, contest: Contest, rows: np.ndarray) -> None:
        first, rival = contest.first, contest.rival
        here, slopes = bench.slopes(first, rows)
        prior = [_known(inquiry, first)]
        parts = [slopes[..., inquiry.free(first.effects)]]
        amplified = np.linalg.norm(slopes.reshape(len(rows), -1), axis=1)
        if rival is None:
            effects, vector = contest.second
            there = _flat(bench.predictions(effects, vector[None], rows))[0]
        else:
            there, slopes = bench.slopes(rival, rows)
            prior.append(_known(inquiry, rival))
            parts.append(-slopes[..., inquiry.free(rival.effects)])
        usual = np.nanmedian(amplified) or 1.0  # a model without parameters amplifies nothing
        noise = np.maximum(1.0, amplified / usual)[:, None]
        difference = (here - there) / noise
        gain = np.concatenate(parts, axis=-1) / noise[..., None]
        self.known = np.isfinite(difference).all(axis=-1) & np.isfinite(gain).all(axis=(1, 2))
        self._square = (difference**2).sum(axis=-1)
        self._pull = np.einsum("idn,id->in", gain, difference)
        self._hold = np.einsum("idn,idm->inm", gain, gain)
        self._prior = block_diag(*prior)

    def best(self, known: np.ndarray) -> list[int]:
        """Return the candidates that decide this contest alone, chosen one after another."""
        taken: list[int] = []
        for _ in range(min(CHOSEN, int(known.sum()))):
            taken.append(self.next_best(known, taken))
        return taken

    def next_best(self, known: np.ndarray, taken: Sequence[int]) -> int:
        """Return which candidate tells most beside those taken."""
        left = [k for k in np.flatnonzero(known).tolist() if k not in taken]
        return max(left, key=lambda k: self.value([*taken, k]))

    def value(self, taken: Sequence[int]) -> float:
        rows = list(taken)
        pull = self._pull[rows].sum(axis=0)
        hold = self._prior + self._hold[rows].sum(axis=0)
        return float(self._square[rows].sum() - pull @ np.linalg.solve(hold, pull))


def _known(inquiry: Inquiry, revision: Revision) -> np.ndarray:
    """Return what the trials so far say on a revision's free parameters, as a precision.

    Where the model misses by more than noise, they say less than noise alone would allow.
    """
    fit, free = revision.fit, inquiry.free(revision.effects)
    slopes = fit.jacobian[..., free]
    precision = np.einsum("i,idn,idm->nm", fit.weights, slopes, slopes)
    excess = float((fit.weights * (fit.residual**2).sum(axis=1)).mean())
    sd = inquiry.expected(revision.effects)[free]
    return precision / max(1.0, excess) + np.diag(1 / sd**2)


MOST_RIVALS, MOST_WEAK = 4, 8
ITERATIONS = 3  # of a fit that only has to show what a rival would predict


def open_contests(
    inquiry: Inquiry,
    found: Found,
    base: Revision,
    verdict: Verdict,
    screens: Mapping[str, Screened],
    rule: Rule,
) -> list[list[Contest]]:
    """Return what is still to be decided, each group only where no trial could decide the former.

    Where nothing is named, these are the effects that came near to it. Where error is left that
    nothing pays for, those that lowered it most, and everywhere those that the trials would
    hardly show. `base` is the model as it is, all there is where the trials are too few; `screens`
    are what the first look said of every effect.
    """
    rivals = [(name, rival) for name in verdict.named for rival in found.rivals.get(name, ())]
    if rivals:
        return [[_between(inquiry, found, *pair) for pair in rivals[:MOST_RIVALS]]]
    top = found.top.revision if found.judged else base
    near = [rung.revision for rung in verdict.near]
    called = verdict.alike
    which = [
        _against((called[0], name), near[0], one)
        for name, one in zip(called[1:], near[1:], strict=True)
    ]
    first = [*which, *(_added(one, top) for one in near)]
    left = verdict.left
    if left is not None and left.rung is not None:
        field = left.rung.revision
        return [first, [Contest(("unknown",), top, (field.effects, field.fit.vector))]]
    weak = [
        one
        for name, one in screens.items()
        if name not in top.effects and one.power < rule.enough_power and one.moved > 0
    ]
    weak.sort(key=lambda one: (one.power, one.p_value))
    tried = [r.revision for e, r in found.judged.items() if e[:-1] == top.effects]
    hardly_seen = [_whether_there(inquiry, top, one.effect) for one in weak[:MOST_WEAK]]
    return [first, [*(_added(one, top) for one in tried if left is not None), *hardly_seen]]


def _against(names: tuple[str, ...], first: Revision, rival: Revision) -> Contest:
    return Contest(names, first, (rival.effects, rival.fit.vector), rival)


def _added(refitted: Revision, top: Revision) -> Contest:
    """Set the model as it is against a refit with more effects, which did not pay."""
    return _against((" + ".join(refitted.effects[len(top.effects) :]),), top, refitted)


def _between(inquiry: Inquiry, found: Found, name: str, rival: str) -> Contest:
    """Set the chosen effects against the same with one that does as well in a place of theirs."""
    first = found.top.revision
    wanted = (set(first.effects) - {name}) | {rival}
    effects = next(e for e in found.early if set(e) == wanted)
    if effects in found.judged:
        return _against((name, rival), first, found.judged[effects].revision)
    fit = inquiry.fit(effects, found.early[effects].vector, ITERATIONS)
    return _against((name, rival), first, Revision(effects, fit))


def _whether_there(inquiry: Inquiry, top: Revision, effect: str) -> Contest:
    """Set the model as it is against the same model with a little of one effect."""
    effects, first = (*top.effects, effect), len(top.fit.vector)
    vector = inquiry.carried(effects, top.effects, top.fit.vector)
    for k, parameter in enumerate(inquiry.model.effects[effect].parameters, first):
        if parameter.null is not None:
            null = float(parameter.to_unit(np.asarray(parameter.null)))
            probes = [float(parameter.to_unit(np.asarray(probe))) for probe in parameter.probes]
            vector[k] = min(probes, key=lambda probe: abs(probe - null))
    return Contest((effect,), top, (effects, vector))

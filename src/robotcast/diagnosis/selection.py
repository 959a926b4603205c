"""Which effects are missing: the smallest set beside which the library has nothing to add."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from robotcast.diagnosis.errors import Floor, Gain, Scales, usual
from robotcast.diagnosis.found import Effects, Found, Rung, Step
from robotcast.diagnosis.inquiry import Inquiry, Revision, fit_base, held_out
from robotcast.diagnosis.library import Beginnings, Library, fit_library, level, library_at
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.diagnosis.sizes import may_be, sizes
from robotcast.fitting.least_squares import Fit


class Selection:
    """A search under way; `found` is what it knows so far.

    Parameters
    ----------
    candidates : names of the effects to try.
    fixed : effects that act from the start.
    tell : called before each step with what is known and what comes next.
    comparisons : effects that share the level, the candidates at least.
    idle : what is missed where nothing acts, (n_trials,), % of the scale.
    """

    def __init__(
        self,
        inquiry: Inquiry,
        candidates: Sequence[str],
        fixed: Sequence[str],
        floor: Floor,
        rule: Rule,
        effort: Effort,
        tell: Callable[[Found, Step, str], object],
        comparisons: int = 0,
        idle: np.ndarray | None = None,
    ) -> None:
        self._inquiry, self._floor, self._rule, self._effort = inquiry, floor, rule, effort
        self._candidates, self._fixed = tuple(candidates), tuple(fixed)
        self._tell, self._comparisons = tell, max(comparisons, len(candidates))
        some = inquiry.beginnings(effort.early, effort.some)
        self.early = Beginnings(some, floor, rule, effort)
        self.found = Found(early=self.early.fits, idle=idle)

    def run(self) -> Found:
        """Search to the end."""
        self.fit_base()
        if self._candidates:
            self.fit_library()
            size = self.shortlist()
            self.judge(size)
            self.simplify()
            self.take_apart()
        return self.choose(self.found.chosen)

    def choose(self, effects: Effects) -> Found:
        """Take a judged model for the chosen one, and look for what could stand in its place."""
        self.found = replace(self.found, chosen=effects)
        self.found = replace(self.found, rivals=self._rivals())
        return self.found

    def fit_base(self) -> None:
        """Fit the model as it is, and judge it."""
        self._next(Step.BASE)
        effort = self._effort
        base = fit_base(self._inquiry, self._fixed, effort)
        self._keep(base)
        self._choose()
        self.early.fit(self._fixed, base.fit.vector)

    def fit_library(self) -> None:
        """Fit the model with all effects to beginnings."""
        self._next(Step.LIBRARY)
        own = self.found.early[self._fixed]
        library = fit_library(
            self.early.inquiry, self._fixed, self._candidates, own, self._effort.library
        )
        self.found = replace(self.found, library=library)

    def shortlist(self) -> int:
        """Refit single effects to beginnings, and larger sets until the library has little to add.

        Return how many effects the smallest set has beside which it has.
        """
        size = 1
        self._refit_size(size)
        if not self._more_adds(self._fixed, self._rule.mostly):
            return 0
        while size < self._rule.most_effects and self._more_adds(
            self.early.best(len(self._fixed) + size)
        ):
            size += 1
            self._refit_size(size)
        return size

    def _more_adds(self, effects: Effects, part: float = 1.0) -> bool:
        """Tell whether more effects predict the beginnings better by a part of what matters.

        Those are the whole library, or one more than these where its fit has ended in a valley.
        Above the floor what matters is a part of what is left: it is worth a further look, and
        that the library does no better is only believed once it was fitted from there.
        """
        early = self.found.early
        base, own = (self.early.expected_error(e) for e in (self._fixed, effects))
        more = [self.early.expected_error(e) for e in early if len(e) == len(effects) + 1]
        above = own > self._rule.at_floor * self._floor.reach and self._floor.percent is not None
        least = part * self._rule.material * (own if above else base)

        def adds() -> bool:
            library = self._library
            whole = min([self.early.expected_error(library.effects, library.fit), *more])
            return own - whole > least

        if effects == self._fixed or not above or adds():
            return adds()
        self._next(Step.LIBRARY)
        library = self._library.again(effects, early[effects], self._effort)
        self.found = replace(self.found, library=library)
        return adds()

    def _refit_size(self, size: int) -> None:
        """Fit the likeliest sets of one size: one step each, then the best of them to the end.

        Those are what the library's slopes promise; of single effects also its starts', a few less;
        and what does best as it is guessed, where guesses do well.
        """
        self._next(Step.BEGINNINGS, f"{size} effect{'s' * (size > 1)} more")
        looked: dict[Effects, Fit] = {}
        library, most = self._library, self._effort.tried
        begin = [(library, *guessed) for guessed in library.guessed(size, most, self._fixed)]
        for some in (library, *(library.starts if size == 1 else ())):
            n = most if some is library else most - 2
            for effects in some.best(size, n, self._fixed):
                starts = self.early.starts(effects, some.start(effects))
                begin += [(some, effects, start) for start in starts]
        for some, effects, start in begin:
            fit = some.look(effects, start)
            if effects not in looked or fit.loss < looked[effects].loss:
                looked[effects] = fit
        early = self.early.inquiry
        begun = {e: early.fit(e, fit.vector, 1, known=fit) for e, fit in looked.items()}
        for effects in sorted(begun, key=lambda e: begun[e].loss)[: most - 1]:
            fit = begun[effects]
            self.early.fit(effects, fit.vector, fit)

    def _swapped(self, effects: Effects, old: str, new: str) -> Effects:
        """Return effects with another one in the place of one, in the library's order."""
        kept = {*effects, new} - {old}
        return (*self._fixed, *(e for e in self._candidates if e in kept))

    def judge(self, size: int) -> None:
        """Fit the finalists to whole trials, judge them on trials held out, and choose."""
        if self.found.above(self.found.base, 1 + self._rule.material):
            self._rematch(self._library.fit)
            self._choose()
        rematched = False
        for smaller in range(size, 0, -1):
            self._judge_finalists(smaller)
            if self._promises(smaller):
                if not rematched:
                    n = len(self._fixed) + smaller
                    fits = [r.revision.fit for e, r in self.found.judged.items() if len(e) == n]
                    self._rematch(min(fits, key=lambda fit: fit.loss))
                rematched = True
                self._polish(smaller)
                self._choose()
            if len(self.found.named) >= smaller and not self._needless(smaller):
                break  # else one of them was needless, or none helps

    def simplify(self) -> None:
        """Judge special cases in the place of chosen effects, and in larger sets that come near.

        Of several the one is judged that fits the beginnings best.
        """
        tried = {self.found.chosen}
        while self.found.named:
            chosen, near = self.found.chosen, self.found.near
            for effects in (chosen, *(rung.effects for rung in near)):
                for name in effects[len(self._fixed) :]:
                    others = [n for n in self._candidates if n not in effects]
                    cases = self._inquiry.special_cases(name, others)
                    swaps = {other: self._swapped(effects, name, other) for other in cases}
                    for other, one in swaps.items():
                        if one not in tried:
                            tried.add(one)
                            self._begin_in_place(one, other, effects, name)
                    if swaps:
                        self._refit(min(swaps.values(), key=lambda e: self.found.early[e].loss))
            self._choose()
            if self.found.chosen == chosen:
                return

    def take_apart(self) -> None:
        """See whether a part of the chosen effects does anything on the beginnings.

        Effects of one kind, as two drives that lag, are one cause.
        """
        named, least = self.found.named, self._rule.material
        base = self.early.expected_error(self._fixed)
        own = [self._inquiry.model.effects[name] for name in named]
        kinds = {
            getattr(e, "kind", (type(e), *((p.name, p.unit) for p in e.parameters))) for e in own
        }
        parts = self.early.parts(self._fixed, named, len(named) - 1) if len(kinds) > 1 else []
        saved = [base - self.early.expected_error(effects) for effects in parts]
        together = bool(parts) and not any(some > least * base for some in saved)
        self.found = replace(self.found, inseparable=together)

    def _begin_in_place(self, effects: Effects, new: str, of: Effects, old: str) -> None:
        """Fit beginnings with a special case in the place of an effect, from where that is."""
        inquiry, fitted = self._inquiry, self.found.judged[of].revision.fit.vector
        start = inquiry.carried(effects, of, fitted)
        held, own = (inquiry.model.effects[name].parameters for name in (old, new))
        values = zip(held, fitted[inquiry.entries(of, old)], strict=True)
        known = {p.name: p.from_unit(unit) for p, unit in values}
        usual = np.mean([*known.values()])  # where each of several joints has its own
        at = [np.clip(p.to_unit(np.asarray(known.get(p.name, usual))), 0.0, 1.0) for p in own]
        start[inquiry.entries(effects, new)] = at
        self.early.fit(effects, start)

    def refit_singles(self, own: np.ndarray) -> Found:
        """Judge single effects, and choose none: a field has shown that something is missing.

        Those that were tried may have ended in a valley, as the library's fit may have. So they
        start from the model's parameters beside which the field explains it, the unit vector `own`.
        """
        if self.found.library is None:  # there are no candidates
            return self.found
        begun = self.early.inquiry.fit(self._fixed, own, 0)
        beside = library_at(self.early.inquiry, self._fixed, self._candidates, begun)
        before = dict(self.found.early)
        self._next(Step.BEGINNINGS, "1 effect more")
        for effects in beside.best(1, self._effort.tried, self._fixed):
            self.early.fit(effects, beside.start(effects))
        kept = {e: r for e, r in self.found.judged.items() if before[e] is self.found.early[e]}
        self.found = replace(self.found, judged=kept)
        self._judge_finalists(1)
        return self.choose(self._fixed)

    def _judge_finalists(self, size: int) -> None:
        """Judge the best set of effects of one size on the beginnings, and those level with it.

        Of the latter those with the fewest strengths come first, as they do where none is better.
        """
        fits, fixed = self.found.early, len(self._fixed)
        best, *sets = sorted(
            (e for e in fits if len(e) == fixed + size), key=lambda e: fits[e].loss
        )
        level = sorted((e for e in sets if self.early.level(best, e)), key=self._strengths)
        for effects in [best, *level[: self._effort.finalists - 1]]:
            self._refit(effects)
        self._choose()

    def _needless(self, size: int) -> bool:
        """Tell whether fewer effects than are chosen would do: all but one of them, or others.

        Those are looked at whose fit to beginnings is worse by less than twice what matters: the
        best of them, and of single effects the simplest that is level with it, too.
        """
        chosen = self.found.chosen
        self.early.parts(self._fixed, self.found.named, size - 1)
        best = self.early.best(len(self._fixed) + size - 1)
        base, least, more = (self.early.expected_error(e) for e in (self._fixed, chosen, best))
        if more - least < 2 * self._rule.material * base:
            self._refit(best)
            if size == 2:
                self._judge_finalists(1)
            self._choose()
        return len(self.found.named) < size

    def _refit(self, effects: Effects) -> None:
        """Fit a model to whole trials and judge it on trials held out."""
        if effects in self.found.judged:
            return
        self._next(Step.REFIT, " + ".join(effects[len(self._fixed) :]))
        fit = self._inquiry.fit_whole(effects, self.early.begun(effects), self._effort.refit)
        self._keep(Revision(effects, fit))

    def _polish(self, size: int) -> None:
        """Go on with the models of one size where that decides: between rivals, above the floor."""
        found, fixed = self.found, len(self._fixed)
        rivals = [r for e, r in found.judged.items() if len(e) == fixed + size]
        best = min(rivals, key=lambda r: r.revision.fit.loss)
        level = [r.effects for r in rivals if self._undecided(best, r)]
        if len(level) < 2 and not found.above(best, 1 + self._rule.material):
            return
        for effects in level:
            self._next(Step.REFIT, " + ".join(effects[fixed:]))
            fit = found.judged[effects].revision.fit
            early = self.early.inquiry.fit(effects, fit.vector, self._effort.refit)
            again = self._inquiry.fit(effects, early.vector, self._effort.refit + 1, like=early)
            if early.loss < found.early[effects].loss:
                self.found.early[effects] = early
            if again.loss < fit.loss:
                self._keep(Revision(effects, again))

    def _promises(self, size: int) -> bool:
        """Tell whether any judged set of one size may turn out to be worth naming."""
        found, rule, n = self.found, self._rule, len(self._fixed) + size
        gains = [found.gain(found.base, r) for e, r in found.judged.items() if len(e) == n]
        return any(g.p_value < rule.equal and g.matters(rule, rule.mostly) for g in gains)

    def _rematch(self, other: Fit) -> None:
        """Give the model as it is the old parameters of a fit with more effects to start from.

        One that lands in a better valley of them would else count for its effects.
        """
        self._next(Step.REMATCH)
        start = other.vector[: len(self.found.base.revision.fit.vector)]
        early = self.early.fit(self._fixed, start)
        again = self._inquiry.fit_whole(self._fixed, [early], self._effort.refit)
        if again.loss < self.found.base.revision.fit.loss:
            self._keep(Revision(self._fixed, again))

    def _choose(self) -> None:
        """Choose the smallest model that pays over which no larger one does.

        It proves that something is missing; of it, no more is chosen than a part that is enough,
        over which no larger one pays either.
        """
        found = self.found
        known = usual([r.errors.low for r in found.judged.values()], self._floor, self._rule)
        scales = Scales(self._floor, 1.0, self._inquiry.groups, known, self._rule)
        scales = replace(scales, base=scales.typical(found.base.errors.waypoint))
        self.found = found = replace(found, scales=scales)
        if found.idle is not None and not found.predicts(found.base):
            scales = replace(scales, base=min(scales.base, scales.typical(found.idle)))
            self.found = found = replace(found, scales=scales)
        gains = {e: found.gain(found.base, r) for e, r in found.judged.items()}
        judged = {e: replace(r, gain=gains[e]) for e, r in found.judged.items()}
        chosen = self._fixed
        hopeful = {e: r for e, r in judged.items() if e == self._fixed or found.predicts(r)}

        def beaten(effects: Effects) -> bool:
            larger = [rung for some, rung in hopeful.items() if len(some) > len(effects)]
            return any(self._pays(found.gain(judged[effects], rung)) for rung in larger)

        for size in sorted({len(effects) for effects in hopeful}):
            simplest = self._simplest([hopeful[e] for e in hopeful if len(e) == size])
            if size > len(self._fixed) and not self._pays(gains[simplest]):
                continue
            chosen = simplest
            if not beaten(chosen):
                break
        if parts := [rung for rung in found.enough(chosen) if not beaten(rung.effects)]:
            fewest = min(len(rung.effects) for rung in parts)
            chosen = self._simplest([rung for rung in parts if len(rung.effects) == fewest])
        self.found = replace(found, judged=judged, chosen=chosen)

    def _simplest(self, rungs: Sequence[Rung]) -> Effects:
        """Return the set with the least expected loss, or one as good with fewer strengths.

        The fits see the same trials, so that it tells more than what they miss of those held out.
        """
        cost = {r.effects: self._inquiry.expected_loss(r.effects, r.revision.fit) for r in rungs}
        best = min(rungs, key=lambda rung: cost[rung.effects])
        level = [
            r
            for r in rungs
            if r is best or self._undecided(best, r) or self._step(best, r) or self._case(best, r)
        ]
        return min(level, key=lambda r: (self._strengths(r.effects), cost[r.effects])).effects

    def _case(self, best: Rung, other: Rung) -> bool:
        """Tell whether another set has a special case of a law, and what else it does may be 0.

        It must do about as well: intervals of strengths that are like each other hold 0 together.
        """
        lost, gained = ([*({*a.effects} - {*b.effects})] for a, b in ((best, other), (other, best)))
        if len(lost) != 1 or not self._inquiry.special_cases(lost[0], gained):
            return False
        if self.found.gain(other, best).matters(self._rule):
            return False
        own = sizes(self._inquiry, best.revision, best.errors.vectors, self._rule.discrepancy)
        law = own[self._inquiry.entries(best.effects, lost[0])]
        return may_be(law, self._inquiry.model.effects[gained[0]].parameters)

    def _step(self, one: Rung, other: Rung) -> bool:
        """Tell whether the model's own step may be all that parts two models."""
        errors = [self.found.typical(rung) for rung in (one, other)]
        return self._floor.is_step(max(errors), min(errors))

    def _strengths(self, effects: Effects) -> int:
        return sum(p.null is not None for p in self._inquiry.parameters(effects))

    def _rivals(self) -> dict[str, tuple[str, ...]]:
        """Return what could stand in the place of every chosen effect.

        The fits to beginnings see the same trials, so that their losses compare them, trial by
        trial: slopes that point the same way are not enough to confuse two effects when a refit
        tells them apart: by a part that matters of what is explained and of what is left, and by
        more than the model's own step errs by, in squares. A law that was fitted as its special
        case, the chosen effect, is none.
        """
        fits, chosen = self.found.early, self.found.chosen
        rivals: dict[str, tuple[str, ...]] = {}
        for other in fits:
            lost, gained = set(chosen) - set(other), set(other) - set(chosen)
            if len(lost) == len(gained) == 1 and self._cannot_tell(chosen, other):
                name, rival = lost.pop(), gained.pop()
                if not self._holds(other, rival, name):
                    rivals[name] = (*rivals.get(name, ()), rival)
        return rivals

    def _holds(self, larger: Effects, law: str, name: str) -> bool:
        """Tell whether a law, as it was fitted, is but the chosen effect that it has as a case.

        So it is where the two differ by less than matters of what the chosen model explains.
        """
        if not self._inquiry.special_cases(law, [name]):
            return False
        before, own, other = (
            self.found.early[e].residual for e in (self._fixed, self.found.chosen, larger)
        )
        apart, moved = (float(((one - own) ** 2).sum()) for one in (other, before))
        return apart < self._rule.material**2 * moved

    def _cannot_tell(self, chosen: Effects, other: Effects) -> bool:
        judged, sets = self.found.judged, (self._fixed, chosen, other)
        if other in judged:
            before, best, worse = (self.found.typical(judged[e]) for e in sets)
            alike = self._undecided(judged[chosen], judged[other])
        else:
            before, best, worse = (self.early.expected_error(e) for e in sets)
            alike = self.early.level(chosen, other)
        matters = self._rule.material * min(worse, before - best)
        return alike or worse - best < matters or self._floor.is_step(worse, best)

    def _undecided(self, best: Rung, other: Rung) -> bool:
        fits = (best.revision.fit, other.revision.fit)
        return level(*fits, self._inquiry.groups, self._rule)

    def _pays(self, gain: Gain) -> bool:
        return gain.pays(self._rule, self._comparisons)

    def _keep(self, revision: Revision) -> None:
        errors = held_out(self._inquiry, revision, self._effort)
        judged = {**self.found.judged, revision.effects: Rung(revision, errors)}
        self.found = replace(self.found, judged=judged)

    @property
    def _library(self) -> Library:
        assert self.found.library is not None
        return self.found.library

    def _next(self, step: Step, what: str = "") -> None:
        self._tell(self.found, step, what)

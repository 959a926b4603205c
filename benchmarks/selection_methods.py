"""Compare ways to select the missing effects, on measurement sets whose hidden effect is known.

python benchmarks/selection_methods.py DIR [--sets abc] [--table FILE]

All start from one fit of the base model and one of the whole library, and end by the same rule:
what they select is refitted, judged on casts held out, and named if it pays.

- sparse: a sparse prior on the linearised library, one variance an effect, pruned by evidence
  (automatic relevance determination, MacKay 1992; Tipping 2001), linearised anew after a refit.
- pursuit: orthogonal matching pursuit on the scores at the tuned base model, with pairs where no
  single effect lowers the loss (Pati et al. 1993).
- forward: rounds that keep the best refit of one more effect, from the tuned base model.
- library: the sets that the library's slopes promise, refitted: what `diagnose` does.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml
from hydra import compose, initialize_config_dir

from robotcast.diagnosis.decision import Unexplained, decide
from robotcast.diagnosis.diagnose import floor_and_noise
from robotcast.diagnosis.found import Effects
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.library import Library
from robotcast.diagnosis.rule import RULE
from robotcast.diagnosis.selection import Selection
from robotcast.measurements.reader import read_measurement_set
from robotcast.reporting.page import markdown
from robotcast.workflow.diagnosing import case_of

ROOT = Path(__file__).resolve().parents[1]

ROUNDS, PRUNED = 30, 0.01  # of the relevance determination; of a strength's prior width
MOST, MATERIAL = RULE.most_effects, RULE.material
FIRST = 3  # refits of a round


def sparse(search: Selection, library: Library) -> Effects:
    """Return what a sparse prior leaves of the linearised library."""
    kept = _relevant(library, library.effects)[:MOST]
    if kept:
        _refit(search, library, kept)
    return kept


def _relevant(library: Library, effects: Sequence[str]) -> Effects:
    """Return the effects whose variance the evidence keeps, the largest first."""
    residual, slopes = library.weighted
    columns = [*library.free, *(k for name in effects for k in library.columns[name])]
    whose = [None] * len(library.free) + [n for n in effects for _ in library.columns[n]]
    sd = library.early.expected(library.effects)[columns]
    flat = slopes.reshape(-1, slopes.shape[-1])[:, columns] * sd
    hold, pull = flat.T @ flat, flat.T @ residual.ravel()
    variance = np.ones(len(columns))
    for _ in range(ROUNDS):
        covariance = np.linalg.inv(hold + np.diag(1 / variance))
        mean = -covariance @ pull
        known = np.clip(1 - np.diag(covariance) / variance, 1e-9, 1)
        variance = np.clip(mean**2 / known, 1e-9, 1e3)
    size = {n: max(abs(m) for m, own in zip(mean, whose, strict=True) if own == n) for n in effects}
    return tuple(sorted((n for n in effects if size[n] > PRUNED), key=lambda n: -size[n]))


def pursuit(search: Selection, library: Library) -> Effects:
    """Return what matching pursuit takes at the tuned base model, one or two at a time."""
    tuned, taken = library.starts[1], ()
    while len(taken) < MOST:
        for size in range(len(taken) + 1, min(len(taken) + 3, MOST + 1)):
            longer = next(e for e in tuned.best(size, 10**6) if set(taken) < set(e))
            saved = tuned.predicted(taken) - tuned.predicted(longer)
            if saved > MATERIAL * tuned.predicted(()):
                break
        else:
            break
        taken = longer
    if taken:
        _refit(search, tuned, taken)
    return taken


def forward(search: Selection, library: Library) -> Effects:
    """Return what rounds of refits take, one effect at a time, from the tuned base model."""
    tuned, taken = library.starts[1], ()
    while len(taken) < MOST:
        longer = [e for e in tuned.best(len(taken) + 1, 10**6) if set(taken) < set(e)][:FIRST]
        for effects in longer:
            _refit(search, tuned, effects)
        error = {e: search.early.expected_error(e) for e in (taken, *longer, ())}
        best = min(longer, key=lambda e: error[e])
        if error[taken] - error[best] < MATERIAL * error[()]:
            break
        taken = best
    return taken


def _refit(search: Selection, slopes: Library, effects: Effects) -> None:
    search.early.fit(effects, slopes.start(effects))


def _selected(search: Selection, method: Callable[..., Effects], library: Library) -> int:
    """Select effects, and refit each part of them to see whether it would do; return how many."""
    taken = method(search, library)
    for size in range(len(taken) - 1, 0, -1):
        search.early.parts((), taken, size)
    return len(taken)


METHODS: dict[str, Callable[[Selection, Library], Effects]] = {
    "sparse": sparse,
    "pursuit": pursuit,
    "forward": forward,
}


def verdicts(
    measurements: Path, overrides: Sequence[str]
) -> dict[str, tuple[set[str], int, float]]:
    """Return every method's verdict on a set, the casts it simulated and the seconds it took."""
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        config = compose("config", overrides=[f"measurements={measurements}", *overrides])
    case = case_of(config, read_measurement_set(measurements))
    floor, noise = floor_and_noise(case)
    inquiry = Inquiry(case.model, case.records, noise)
    start, found = time.monotonic(), {}
    search = Selection(inquiry, case.candidates, (), floor, case.rule, case.effort, lambda *_: None)
    search.fit_base()
    search.fit_library()
    casts, seconds, common = inquiry.simulated, time.monotonic() - start, search.found
    for name in (*METHODS, "library"):
        before, begun = inquiry.simulated, time.monotonic()
        own = copy(search)
        own.early = copy(search.early)
        own.early.fits = dict(common.early)
        own.found = replace(common, judged=dict(common.judged), early=own.early.fits)
        assert common.library is not None
        size = _selected(own, METHODS[name], common.library) if name in METHODS else own.shortlist()
        own.judge(size)
        own.simplify()
        own.take_apart()
        said = decide(own.found, Unexplained, own.refit_singles).words
        more = inquiry.simulated - before, time.monotonic() - begun
        found[name] = set(said), casts + more[0], seconds + more[1]
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description="Compare ways to select effects.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sets", default="", help="names of one letter, all by default")
    parser.add_argument("--table", type=Path, help="a Markdown file for the table")
    parser.add_argument("--override", action="append", default=[], help="of the configuration")
    given = parser.parse_args()
    answers = yaml.safe_load((given.folder / "answers.yaml").read_text(encoding="utf-8"))
    names = (*METHODS, "library")
    rows, right, cost = [], dict.fromkeys(names, 0), {n: np.zeros(2) for n in names}
    for one in sorted(given.sets or answers):
        found = verdicts(given.folder / one, given.override)
        cells = [one, answers[one]["hidden"]]
        for name, (said, casts, seconds) in found.items():
            good = said in [set(some) for some in answers[one]["accept"]]
            right[name] += good
            cost[name] += casts, seconds
            cells.append(("" if good else "**not** ") + " + ".join(sorted(said)))
        rows.append(cells)
        print(" | ".join(cells), flush=True)
    n = len(rows)
    rows += [["", "right", *(f"{right[m]} of {n}" for m in names)]]
    rows += [["", "casts a set", *(f"{cost[m][0] / n:.0f}" for m in names)]]
    rows += [["", "seconds a set", *(f"{cost[m][1] / n:.0f}" for m in names)]]
    text = markdown(["set", "hidden", *names], rows)
    print(text)
    if given.table:
        given.table.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()

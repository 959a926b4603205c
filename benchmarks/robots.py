"""Hidden effects of small robots: does the diagnosis name what was hidden, and nothing else?

python benchmarks/robots.py [CASE ...] [--output DIR] [--alone] [--table FILE]
    [--draw SEED [--cases N]]

Cases are made by robot_truth.py, their answers sealed until a case is diagnosed; with --draw they
are drawn at random. What was diagnosed before stands in DIR and is not done again. Where logs
cannot tell two effects apart, the motions that the diagnosis asks for are logged, and it is asked
again. Beside each diagnosis, unless --alone: the oracle, which tries the hidden effect alone, and
everything unfrozen, which fits all parameters at once.
"""

import argparse
import json
import shutil
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import robotcast  # noqa: F401 # before NumPy: it settles how processors round

# isort: split
import mujoco
import mujoco.rollout
import numpy as np
from robot_draws import draw, drawn
from robot_truth import CASES, Hidden, log_next, make

from robotcast.diagnosis.diagnose import Case, diagnose, floor_and_noise
from robotcast.diagnosis.inquiry import Inquiry, Revision, fit_base, held_out
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.files import plain, unseal, write_text
from robotcast.reporting.page import markdown
from robotcast.robots.by_joint import diagnose_robot
from robotcast.robots.effects import DeadTime, ModelField
from robotcast.robots.robot_case import RobotCase, read_case

VECTORS = 8


def score(
    case: str, hidden: Hidden, folder: Path, alone: bool, seed: Sequence[int] = (0,)
) -> dict[str, Any]:
    """Make and diagnose one case, open its answer, and say how it went."""
    sealed = folder.parent / "answers" / f"{case}.txt"
    sealed.parent.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(folder, ignore_errors=True)  # with the motions that were asked for last time
    make(hidden, folder, sealed, seed)
    began, busy = time.monotonic(), time.process_time()
    asked = read_case(folder, threads=1)
    asked, said = diagnose_robot(asked, _question, lambda found: None)
    seconds, cpu = time.monotonic() - began, time.process_time() - busy
    errors = [rung["heldout_typical_error_percent"] for rung in said["ladder"]]
    truth = unseal(sealed)
    answer, sizes = set(truth["answer"]), truth["sizes"]
    known = said["model"]["parameters"] if said["model"] else {}
    fitted = {
        name: [known[name]["low"], known[name]["value"], known[name]["high"], size]
        for name, size in sizes.items()
        if name in known
    }
    confused = {e for some in said["confusion_set"] for e in some}
    told = set(said["verdict"])
    row = {
        "case": case,
        "answer": sorted(answer),
        "either": truth["either"],
        "said": said["verdict"] if said["code"] != "cannot tell" else ["cannot tell"],
        "confused": sorted(confused - told),
        "green": not said["unexplained"],
        "near": said["nearest"][:1],
        "right": told == answer if not truth["either"] else told < answer <= told | confused,
        "among": answer <= told | confused,
        "sizes": fitted,
        "errors": [round(e, 3) for e in errors],
        "floor": round(said["noise_floor_percent"], 2),
        "candidates": sum(e.depends_on is None for e in asked.model.effects.values()),
        "seconds": round(seconds),
        "cpu_seconds": round(cpu),
        "cost": cost(asked),
    }
    if truth["either"] and said["next_actions"]:
        log_next(hidden, folder, asked.motions.rows(said["next_actions"], folder))
        further = read_case(folder, threads=1)
        _, again = diagnose_robot(further, _question, lambda _: None)
        row["after_next"] = {k: again[k] for k in ("verdict", "confusion_set")}
    if not alone and answer <= set(asked.model.effects):
        row["oracle"] = _oracle(asked, answer)
        row |= _unfrozen(asked) | _brute_force(asked)
    return row


def cost(asked: RobotCase) -> dict[str, float]:
    """Return CPU time of ours over that of `mujoco.rollout` on the bare model, one thread each."""
    model, windows = asked.model, asked.model.rollout.windows
    bare, times_s = asked.robot.model, [record.times_s for record in model.records]
    steps = round(times_s[0][-1] / bare.opt.timestep) + 1
    state = np.zeros((len(windows), mujoco.mj_stateSize(bare, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    state[:, 1 : 1 + bare.nq + bare.nv] = [np.r_[w.qpos, w.qvel] for w in windows]
    control = np.zeros((len(windows), steps, bare.nu))
    driven = [at.actuator for at in asked.robot.drive if at.actuator is not None]
    for row, w in zip(control, windows, strict=True):
        row[:, driven] = model.rollout.logs[w.log].drive[w.first]
    began = time.process_time()
    for _ in range(VECTORS):
        mujoco.rollout.rollout(bare, mujoco.MjData(bare), state, control)
    took = [time.process_time() - began]
    soft = [name for name in model.effects if name.startswith("elastic")][:1]
    for names in ((), soft):
        own = [p.probes[-1] for name in names for p in model.effects[name].parameters]
        began = time.process_time()
        vectors = np.tile(own, (VECTORS, 1)).reshape(VECTORS, -1)
        effects = [model.effects[n] for n in names]
        model.rollout.simulate(range(len(windows)), times_s, effects, vectors)
        took.append(time.process_time() - began)
    return {"no effect": round(took[1] / took[0], 2), "elastic": round(took[2] / took[0], 2)}


def _oracle(asked: RobotCase, answer: set[str]) -> list[float]:
    """Return the error before and with the hidden effects, which alone are tried."""
    names = [n for n, e in asked.model.effects.items() if e.depends_on is None]
    others = [name for name in names if name not in answer]
    said = diagnose(asked.question(others, (), Rule(), Effort()), lambda found: None)
    return [round(rung["heldout_typical_error_percent"], 3) for rung in said["ladder"]]


def _unfrozen(asked: RobotCase) -> dict[str, Any]:
    """Fit every parameter that an MJCF has; say the held-out error and what changed most."""
    model, effort, inquiry = asked.model, Effort(), _inquiry(asked)
    names = [n for n, e in model.effects.items() if isinstance(e, ModelField | DeadTime)]
    fitted = fit_base(inquiry, names, effort)
    missed = held_out(inquiry, fitted, effort)
    parameters = inquiry.parameters(names)[len(model.parameters) :]
    values = inquiry.values(names, fitted.fit.vector)[0, len(model.parameters) :]
    owners = [name for name in names for _ in model.effects[name].parameters]
    changes = [
        abs(v - p.nominal) / max(abs(np.array(p.probes) - p.nominal), default=1.0)
        for v, p in zip(values, parameters, strict=True)
    ]
    return {
        "unfrozen": round(float(np.median(missed.waypoint)), 3),
        "changed_most": owners[int(np.argmax(changes))],
    }


def _brute_force(asked: RobotCase) -> dict[str, Any]:
    """Refit every effect alone to all windows; say which predicts best where it is held out."""
    began, effort, inquiry = time.process_time(), Effort(), _inquiry(asked)
    names = [n for n, e in asked.model.effects.items() if e.depends_on is None]
    base, missed = fit_base(inquiry, (), effort).fit.vector, {}
    for name in names:
        start = inquiry.nominal((name,))
        start[: len(base)] = base
        fitted = Revision((name,), inquiry.fit((name,), start, effort.library))
        missed[name] = float(np.median(held_out(inquiry, fitted, effort).waypoint))
    best = min(names, key=lambda name: missed[name])
    return {
        "brute_force": best,
        "brute_force_error": round(missed[best], 3),
        "brute_force_cpu_seconds": round(time.process_time() - began),
    }


def _question(asked: RobotCase) -> Case:
    return asked.question((), (), Rule(), Effort())


def _inquiry(asked: RobotCase) -> Inquiry:
    case = _question(asked)
    return Inquiry(asked.model, case.records, floor_and_noise(case)[1])


COLUMNS = """mechanism, named right, truth among the confusable, hidden below 1.5 times the floor,
false alarms, unknown, intervals that cover, drop of the oracle's, unfrozen: error of ours,
unfrozen: largest change is right, brute force: right, a guess is right,
CPU seconds at most, brute force: CPU seconds at most"""


def table(rows: Sequence[dict[str, Any]], names: Sequence[str]) -> str:
    """Return one line a mechanism, by the rows' names, and one of all; without empty columns."""
    lines = []
    for name in [*dict.fromkeys(names), "all"]:
        own = [row for row, of in zip(rows, names, strict=True) if name in (of, "all")]
        clean = [row for row in own if row["answer"] == ["none"]]
        hidden = [row for row in own if row not in clean]
        fitted = [some for row in own for some in row["sizes"].values()]
        hits = [low <= true <= high for low, _, high, true in fitted]
        beside = [row for row in hidden if "oracle" in row]
        ours, oracles = (
            sum(row[errors][0] - row[errors][-1] for row in beside)
            for errors in ("errors", "oracle")
        )
        ratio = [row["unfrozen"] / row["errors"][-1] for row in beside]
        named = [row["changed_most"] in row["answer"] for row in beside]
        best = [row["answer"] == [row["brute_force"]] for row in beside]
        guess = [1 / (1 + row["candidates"]) for row in own]
        lines.append(
            [
                name,
                f"{sum(row['right'] for row in hidden)} of {len(hidden)}",
                f"{sum(row['among'] for row in hidden)} of {len(hidden)}",
                str(sum(row["errors"][0] <= 1.5 * row["floor"] for row in hidden)),
                f"{sum(not row['right'] for row in clean)} of {len(clean)}",
                str(sum(row["said"] == ["unknown"] for row in hidden)),
                f"{sum(hits)} of {len(hits)}",
                f"{100 * ours / oracles:.0f} %" if oracles else "–",
                f"{np.median(ratio):.2f}" if ratio else "–",
                f"{sum(named)} of {len(named)}",
                f"{sum(best)} of {len(best)}",
                f"{100 * np.mean(guess):.0f} %",
                str(max(row["cpu_seconds"] for row in own)),
                str(max((row["brute_force_cpu_seconds"] for row in beside), default="–")),
            ]
        )
    columns = list(zip(COLUMNS.replace("\n", " ").split(", "), *lines, strict=True))
    full = [column for column in columns if {*column[1:]} - {"–", "0 of 0", "0"}]
    head, *lines = zip(*full, strict=True)
    return markdown(head, lines)


def every(rows: Sequence[dict[str, Any]]) -> str:
    """Return one line a case, and what further motions told."""
    columns = ["case", "hidden", "said", "confused with", "error [%]", "floor", "CPU s"]
    lines, more = [], ""
    for row in rows:
        said = ("" if row["right"] else "**not** ") + " + ".join(row["said"])
        if row["said"] == ["none"] and not row.get("green", True):
            said += ", not green"  # the page says that something may be missing, and what is near
            said += "".join(f": near {' + '.join(one)}" for one in row["near"])
        errors = " → ".join(
            f"{e:.2f}" for e in dict.fromkeys((row["errors"][0], row["errors"][-1]))
        )
        joined = " or " if row.get("either") else " + "
        hidden, confused = joined.join(row["answer"]), ", ".join(row["confused"])
        shown = [row["case"], hidden, said, confused, errors, row["floor"], row["cpu_seconds"]]
        lines.append([str(one) for one in shown])
        if again := row.get("after_next"):
            others = {e for some in again["confusion_set"] for e in some} - {*again["verdict"]}
            pair, named = " and ".join(row["answer"]), " + ".join(again["verdict"])
            left = ", ".join(sorted(others)) or "nothing"
            more += (
                f"\n{row['case']}: these logs cannot tell {pair} apart. With the motions that the "
                f"diagnosis asks for: {named}, confused with {left}.\n"
            )
    return markdown(columns, lines) + more


DRAW = """# Robots with an effect that nobody picked

`python benchmarks/robots.py --alone --draw {seed} --cases {cases} --table FILE`: the simulated
robots of [the benchmark](robots.md) with cases drawn at random from a seed: mechanism, effect,
place, size, motions and noise. One in six hides nothing, one in six two effects of different
kinds, one in twelve a torque law that the library lacks (ripple, a soft stop on one side). Sizes
are log-uniform in units of what is usual on the mechanism (`DRAWN` in benchmarks/robot_draws.py),
and drawn again until the logs with and without the effect differ by more than five times the
encoders' noise within two seconds, and every joint stays within twice its usual range and one of
them moves a tenth of it in every log.

"""
HEAD = """# Robots with a hidden effect

`python benchmarks/robots.py --table reports/robots.md`: simulated robots, made with another
integrator at a tenth of the step, with encoders that are quantised, noisy and late. Errors are
typical errors on windows held out, in % of the usual motion. The oracle tries the hidden effect
alone; "unfrozen" fits all parameters of the MJCF at once; brute force refits every effect alone and
names what predicts best, so that it never says "none" or names two; a guess is a candidate or
"none".

"""


def main() -> None:
    parser = argparse.ArgumentParser(description="Diagnose robots with a hidden effect.")
    parser.add_argument("cases_named", nargs="*", metavar="CASE")
    parser.add_argument("--output", type=Path, metavar="DIR", help="where what was done stands")
    parser.add_argument("--alone", action="store_true", help="without oracle and unfrozen")
    parser.add_argument("--table", type=Path, metavar="FILE", help="a Markdown file for the tables")
    parser.add_argument("--draw", type=int, metavar="SEED", help="draw the cases at random")
    parser.add_argument("--cases", type=int, default=24, metavar="N", help="how many are drawn")
    given = parser.parse_args()
    fixed = {case: (hidden.mechanism, "") for case, hidden in CASES.items()}
    known = fixed if given.draw is None else drawn(given.draw, given.cases)
    own = "" if given.draw is None else f"/draw_{given.draw}_of_{given.cases}"
    output = given.output or Path(f"outputs/robots{own}")
    rows, names = [], given.cases_named or known
    for case in names:
        path, seed = output / f"{case}.json", (0,)
        if not path.is_file():
            if given.draw is not None:
                seed = (given.draw, list(known).index(case))
            hidden = CASES[case] if given.draw is None else draw(*known[case], seed)
            row = plain(score(case, hidden, output / case, given.alone, seed))
            write_text(path, json.dumps(row, ensure_ascii=False))
            print(json.dumps(row, ensure_ascii=False), flush=True)
        rows.append(json.loads(path.read_text(encoding="utf-8")))
    by_robot = table(rows, [known[case][0] for case in names])
    print(by_robot)
    if given.table:
        head = HEAD if given.draw is None else DRAW.format(seed=given.draw, cases=given.cases)
        write_text(given.table, f"{head}{by_robot}\n\n{every(rows)}")


if __name__ == "__main__":
    main()

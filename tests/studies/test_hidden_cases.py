"""What the benchmark draws, measures and seals."""

from concurrent.futures import Executor, Future
from dataclasses import replace
from pathlib import Path
from shutil import rmtree

import numpy as np
import pytest

from robotcast.casts.curves import PlanLimits
from robotcast.files import seal, unseal
from robotcast.measurements.reader import read_measurement_set
from robotcast.rigs.virtual.hiding import LIBRARY, MECHANISMS, OUTSIDE, make_effect
from robotcast.rigs.virtual.mechanisms import HiddenEffect
from robotcast.rigs.virtual.rig import Eye
from studies.hidden_effects.cases import Case, choose_actions, draw_cases
from studies.hidden_effects.measuring import RIG, Bench, further_casts, measure_case, measure_cases

CONTROL = Case("case-001", "control", "cable1", 5)
EFFECTS = ("board_tilt", "camera_latency")
STRENGTHS = ({"name": "weak", "noise_floors": 2.0}, {"name": "strong", "noise_floors": 6.0})
COMPOSITION = {
    "noise_floor_percent": {"cable1": 0.5, "cable2": 1.3},
    "vary": {"friction": 0.1},
    "strengths": STRENGTHS,
    "effects": EFFECTS,
    "draws": 2,
    "controls": ({"cable": "cable1", "varied": False}, {"cable": "cable2", "outliers": 1}),
    "pairs": (("air_drag", "tool_lag"),),
    "outside": ("rubber_band",),
}
FEASIBLE = np.array(
    [[0.3, 0.64, -0.2, 0.7, 0.3, v] for v in (1.3, 1.4, 1.5)]
    + [[0.4, 0.64, -0.3, 0.7, 0.3, v] for v in (1.3, 1.4, 1.5)]
)


class Here(Executor):
    """Runs at once, in this process."""

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        future.set_result(fn(*args, **kwargs))
        return future


@pytest.fixture
def bench(rig) -> Bench:
    return Bench(
        rigs={"cable1": replace(rig, truth=replace(rig.truth, segments=10, step_s=0.002))},
        feasible=FEASIBLE,
        counts={"actions": 3, "repeated": 1, "times": 2},
        eye=Eye(),
        limits=PlanLimits(),
        shift_casts=2,
    )


PLACE = {"board_tilt": {"sx": 0.0, "sy": 1.0}}
TILT = Case("case-001", "single", "cable1", 5, {"friction": 1.1}, PLACE, "strong", 0.7)


def written(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_the_same_seed_draws_the_same_cases_and_another_seed_others():
    assert draw_cases(COMPOSITION, 3) == draw_cases(COMPOSITION, 3)
    assert draw_cases(COMPOSITION, 3) != draw_cases(COMPOSITION, 4)


def test_every_effect_is_drawn_at_every_strength_as_often_as_asked():
    cases = draw_cases(COMPOSITION, 0)
    assert len(cases) == 2 * 2 * 2 + 2 + 1 + 1
    singles = [(*case.hidden, case.strength) for case in cases if case.kind == "single"]
    assert sorted(singles) == sorted([(e, s) for e in EFFECTS for s in ("weak", "strong")] * 2)
    assert len({case.seed for case in cases}) == len(cases)
    wanted = {round(case.wanted_percent, 9) for case in cases if case.hidden}
    assert wanted <= {1.0, 3.0, 2.6, 7.8}


def test_names_tell_nothing_about_what_is_hidden():
    kinds = [[case.kind for case in draw_cases(COMPOSITION, seed)] for seed in range(4)]
    assert [c.name for c in draw_cases(COMPOSITION, 0)] == [f"case-{n:03d}" for n in range(1, 13)]
    assert len({tuple(order) for order in kinds}) == 4


def test_an_effect_that_cannot_be_hidden_is_refused_with_those_that_can():
    assert not LIBRARY.keys() & OUTSIDE.keys()
    with pytest.raises(ValueError, match=r"gravity_wave .*board_tilt"):
        draw_cases({**COMPOSITION, "effects": ("gravity_wave",)}, 0)
    with pytest.raises(ValueError, match=r"board_tilt .*rubber_band"):
        draw_cases({**COMPOSITION, "outside": ("board_tilt",)}, 0)


@pytest.mark.parametrize("name", MECHANISMS)
def test_every_mechanism_can_be_drawn_and_made(name):
    mechanism = MECHANISMS[name]
    place = mechanism.place(np.random.default_rng(0))
    given = mechanism.parameters(place, mechanism.start)
    assert isinstance(make_effect(name, given), HiddenEffect)
    doubled = mechanism.parameters(place, 2 * mechanism.start)
    grown = [key for key in given if doubled[key] != given[key]]
    assert grown and all(doubled[key] == pytest.approx(2 * given[key]) for key in grown)
    assert mechanism.start <= mechanism.most


def test_half_of_the_actions_are_mirrored_and_the_repeats_come_last():
    random = np.random.default_rng(0)
    chosen = choose_actions(FEASIBLE, random, actions=6, repeated=2, times=3)
    assert [action_id for action_id, _ in chosen] == [0, 1, 2, 3, 4, 5, 0, 0, 1, 1]
    by_id = dict(chosen[:6])
    assert sum(action.theta1_rad < 0 for action in by_id.values()) == 3
    assert all(action == by_id[action_id] for action_id, action in chosen[6:])


def test_alike_actions_lie_near_each_other_on_one_side():
    spread = np.random.default_rng(0).uniform(size=(400, 6))
    random = np.random.default_rng(0)
    chosen = choose_actions(spread, random, actions=8, repeated=0, times=1, alike=0.05)
    rows = np.array([action.as_array() for _, action in chosen])
    apart, usual = (np.ptp(some, axis=0).mean() for some in (rows, spread[:8]))
    assert apart < 0.8 * usual
    assert (rows[:, 0] >= 0).all()


@pytest.mark.parametrize(
    ("counts", "said"),
    [
        ({"actions": 3, "repeated": 1, "times": 2, "alike": 0.0}, "0 < alike ≤ 1"),
        ({"actions": 3, "repeated": 4, "times": 2}, "0 ≤ repeated ≤ actions"),
        ({"actions": 9, "repeated": 0, "times": 1}, "9 actions wanted, 6 are feasible"),
    ],
)
def test_counts_that_cannot_be_are_refused(counts, said):
    with pytest.raises(ValueError, match=said):
        choose_actions(FEASIBLE, np.random.default_rng(0), **counts)


def test_a_sealed_answer_opens_as_it_was_and_shows_no_word(tmp_path):
    answer = {"effects": [{"effect": "board_tilt", "parameters": {"sx": 0.1}}]}
    path = tmp_path / "case-001.sealed"
    seal(answer, path)
    assert unseal(path) == answer
    assert b"tilt" not in path.read_bytes()
    path.write_text("nonsense")
    with pytest.raises(ValueError, match="not a sealed answer"):
        unseal(path)


@pytest.mark.rig
def test_a_case_moves_the_paths_as_far_as_wanted_and_its_answer_says_by_what(bench):
    measured, answer = measure_case(TILT, bench, Here())
    (hidden,) = answer["effects"]
    assert hidden["effect"] == "board_tilt"
    assert hidden["parameters"]["sx"] == 0
    assert 0 < hidden["parameters"]["sy"] < 0.08
    assert answer["shift_percent"] == pytest.approx(0.7, rel=0.25)
    assert measured.rig == RIG
    assert [t.action_id for t in measured.trials] == [0, 1, 2, 0]
    assert measured.noise_m == bench.eye.noise_m


@pytest.mark.rig
def test_a_control_hides_nothing_and_a_cast_led_astray_is_half_a_metre_off_and_no_repeat(bench):
    good, answer = measure_case(CONTROL, bench, Here())
    assert answer["effects"] == []
    assert answer["shift_percent"] == 0
    spoilt, _ = measure_case(replace(CONTROL, outliers=1), bench, Here())
    off = [
        np.linalg.norm((s.waypoints_m - g.waypoints_m)[0])
        for s, g in zip(spoilt.trials, good.trials, strict=True)
    ]
    assert sorted(off) == pytest.approx([0, 0, 0, 0.5])
    assert off[0] == off[3] == 0


@pytest.mark.rig
def test_a_finished_case_is_not_measured_again_and_another_is_refused(bench, tmp_path):
    def measure(case: Case) -> int:
        return measure_cases([case], bench, tmp_path, tmp_path, workers=1)

    assert measure(CONTROL) == 1
    measured = tmp_path / "sets" / CONTROL.name
    before = written(measured)
    assert measure(CONTROL) == 0
    assert written(measured) == before
    assert len(read_measurement_set(measured).trials) == 4
    assert [path.name for path in (tmp_path / "answers").iterdir()] == ["case-001.sealed"]
    with pytest.raises(ValueError, match=r"case-001\.sealed: was drawn otherwise"):
        measure(replace(CONTROL, seed=6))
    rmtree(tmp_path / "answers")
    with pytest.raises(ValueError, match=r"case-001: has no answer"):
        measure(CONTROL)


@pytest.mark.rig
def test_a_set_that_was_removed_comes_back_and_never_from_another_rig(bench, tmp_path):
    def measure(bench: Bench) -> dict[str, bytes]:
        measure_cases([TILT], bench, tmp_path / "data", tmp_path / "reports", workers=1)
        first = written(tmp_path / "data" / "sets" / TILT.name)
        rmtree(tmp_path / "data")
        return first

    assert measure(bench) == measure(bench)
    rig = bench.rigs["cable1"]
    other = replace(rig, truth=replace(rig.truth, friction=1.5 * rig.truth.friction))
    with pytest.raises(ValueError, match=r"case-001\.sealed: was sealed for casts of another rig"):
        measure(replace(bench, rigs={"cable1": other}))


@pytest.mark.rig
def test_further_casts_join_the_set_with_what_its_case_hides(bench):
    measured, answer = measure_case(TILT, bench, Here())
    rig, first = bench.rigs["cable1"], measured.trials[1].action

    def more(hidden):
        actions = [first, first.mirrored(), first]
        given = {**answer, "effects": hidden}
        return further_casts(measured, given, rig, actions, bench.eye, bench.limits, Here())

    grown = more(answer["effects"])
    assert grown.trials[:4] == measured.trials
    assert [(t.trial, t.action_id) for t in grown.trials[4:]] == [(4, 3), (5, 4), (6, 3)]
    moved = grown.trials[4].endpoint_m - more([]).trials[4].endpoint_m
    assert moved[1] > 0.003

"""Balls dropped from a bridge: the example of a model and data of one's own."""

import importlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from robotcast.diagnosis.diagnose import Case, diagnose
from robotcast.diagnosis.model import Record

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "ball_drop"
TIMES_S = np.arange(0.02, 3.6, 1 / 15)
G = 9.81
DRAG = {"linear_drag", "quadratic_drag"}


@pytest.fixture(scope="module")
def rooms() -> Iterator[dict[str, ModuleType]]:
    """The example's files, as its script imports them."""
    names = ("candidates", "free_fall", "drops", "run")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(EXAMPLE))
        yield {name: importlib.import_module(name) for name in names}


@pytest.fixture(scope="module")
def model(rooms) -> Any:
    return rooms["free_fall"].FreeFall(rooms["candidates"].mechanisms())


@pytest.fixture(scope="module")
def whiffle(rooms) -> tuple[Record, ...]:
    return rooms["drops"].read_drops([b for b in rooms["drops"].BALLS if "Whiffle" in b])


@pytest.fixture(scope="module")
def said_of_whiffle_balls(rooms, tmp_path_factory) -> dict[str, Any]:
    return rooms["run"].diagnose_balls("whiffle", tmp_path_factory.mktemp("whiffle"))


def ball(mass_kg: float, diameter_m: float) -> Record:
    factors = {"mass": mass_kg, "diameter": diameter_m}
    return Record(1, 1, TIMES_S, np.zeros((len(TIMES_S), 1)), factors)


def drag_per_m(mass_kg: float, diameter_m: float) -> float:
    return 0.5 * 1.2 * np.pi / 4 * diameter_m**2 / mass_kg


def predicted(model: Any, record: Record, active: list[str], *values: float) -> np.ndarray:
    return model.predict([record], active, np.array([[0.0, *values]]))[0, 0, :, 0]


def test_without_air_a_ball_falls_half_g_t_squared(model) -> None:
    fallen = predicted(model, ball(0.03, 0.07), [])
    np.testing.assert_allclose(fallen, G / 2 * TIMES_S**2, rtol=1e-12)


@pytest.mark.parametrize(("mass_kg", "diameter_m"), [(0.028, 0.073), (2.3, 0.213)])
def test_with_quadratic_drag_it_falls_as_the_logarithm_of_cosh(model, mass_kg, diameter_m) -> None:
    k = 0.5 * drag_per_m(mass_kg, diameter_m)
    exact = np.log(np.cosh(np.sqrt(G * k) * TIMES_S)) / k
    fallen = predicted(model, ball(mass_kg, diameter_m), ["quadratic_drag"], 0.5)
    np.testing.assert_allclose(fallen, exact, atol=1e-4)


def test_with_linear_drag_its_speed_nears_the_end_exponentially(model) -> None:
    rate = 0.6 * 10.0 * drag_per_m(0.028, 0.073)
    exact = G / rate * (TIMES_S - (1 - np.exp(-rate * TIMES_S)) / rate)
    fallen = predicted(model, ball(0.028, 0.073), ["linear_drag"], 0.6)
    np.testing.assert_allclose(fallen, exact, atol=1e-4)


def test_both_laws_of_drag_brake_alike_at_ten_metres_a_second(rooms, model, whiffle) -> None:
    balls, speed = rooms["candidates"].Balls.of(whiffle), np.full((1, len(whiffle)), 10.0)
    pulls = [model.effects[name].acceleration(speed, balls, c=0.5) for name in sorted(DRAG)]
    np.testing.assert_allclose(*pulls)


def test_a_heavy_ball_feels_less_drag_than_a_light_one_of_its_size(model) -> None:
    light, heavy = (predicted(model, ball(m, 0.2), ["quadratic_drag"], 0.5) for m in (0.3, 3.0))
    assert light[-1] < heavy[-1] < G / 2 * TIMES_S[-1] ** 2


def test_buoyancy_takes_the_weight_of_the_displaced_air(model) -> None:
    air_kg = 1.2 * np.pi / 6 * 0.1**3
    fallen = predicted(model, ball(0.01, 0.1), ["buoyancy"], 1.0)
    np.testing.assert_allclose(fallen, (1 - air_kg / 0.01) * G / 2 * TIMES_S**2)


def test_clock_and_camera_act_on_what_is_seen(model) -> None:
    late = predicted(model, ball(1.0, 0.1), ["release_time"], 0.1)
    np.testing.assert_allclose(late, G / 2 * np.maximum(TIMES_S - 0.1, 0) ** 2, atol=1e-9)
    long = predicted(model, ball(1.0, 0.1), ["scale_error"], 0.05)
    np.testing.assert_allclose(long, 1.05 * G / 2 * TIMES_S**2)


def test_at_its_null_no_mechanism_changes_a_bit(model, whiffle) -> None:
    plain = model.predict(whiffle, [], np.zeros((1, 1)))
    for name, effect in model.effects.items():
        null = np.zeros((1, 1 + len(effect.parameters)))
        np.testing.assert_array_equal(model.predict(whiffle, [name], null), plain)


def test_vectors_and_balls_are_independent(model, whiffle) -> None:
    vectors = np.array([[0.1, 0.2, 0.05], [0.0, 0.6, -0.02], [-0.1, 0.0, 0.0]])
    active = ["quadratic_drag", "release_time"]
    together = model.predict(whiffle, active, vectors)
    k_max = max(len(r.times_s) for r in whiffle)
    assert together.shape == (3, len(whiffle), k_max, 1)
    alone = model.predict(whiffle[2:3], active, vectors[1:2])
    k = alone.shape[2]
    np.testing.assert_array_equal(together[1, 2, :k], alone[0, 0])
    assert np.isnan(together[1, 2, k:]).all()


def test_the_model_is_short() -> None:
    assert len((EXAMPLE / "free_fall.py").read_text(encoding="utf-8").splitlines()) <= 60


def test_a_drop_starts_at_its_release(whiffle) -> None:
    for record in whiffle:
        assert 0 <= record.times_s[0] < 0.1  # a frame and a half
        assert abs(record.measured[0, 0]) < 0.15
        assert 30 < record.measured[-1, 0] < 40
    assert len({record.group for record in whiffle}) == len(whiffle)


def test_balls_that_were_not_weighed_are_refused(rooms) -> None:
    with pytest.raises(ValueError, match="Volleyball are not known"):
        rooms["drops"].read_drops(["Volleyball"])
    with pytest.raises(ValueError, match="there are Baseball"):
        rooms["run"].diagnose_balls("cannon", Path("unused"))


def test_air_drag_is_named_for_the_whiffle_balls(said_of_whiffle_balls) -> None:
    said = said_of_whiffle_balls
    assert len(said["verdict"]) == 1
    assert set(said["verdict"]) <= DRAG
    base, top = (rung["heldout_waypoint_error_percent"] for rung in said["ladder"])
    assert base > 250  # cm
    assert top <= 40
    assert top < 1.1 * said["noise_floor_percent"]


def test_the_size_of_the_drag_is_that_of_a_ball(said_of_whiffle_balls) -> None:
    (named,) = said_of_whiffle_balls["verdict"]
    row = next(r for r in said_of_whiffle_balls["ranking"] if r["effect"] == named)
    size = row["parameters"]["c"]
    assert 0.4 < size["low"] < size["value"] < size["high"] < 0.8


def test_air_drag_is_not_claimed_for_the_bowling_ball(rooms, tmp_path) -> None:
    said = rooms["run"].diagnose_balls("bowling", tmp_path)
    assert not DRAG & set(said["verdict"])
    assert said["code"] == "cannot tell" and not said["conclusive"]
    assert (tmp_path / "index.html").exists()


@pytest.mark.parametrize("law", sorted(DRAG))
def test_the_laws_of_drag_are_told_apart_on_balls_that_follow_one(model, whiffle, law) -> None:
    rng = np.random.default_rng(1)
    records = []
    for record in whiffle:
        fallen = predicted(model, record, [law], 0.6 * (1 + 0.05 * rng.normal()))
        noise = 0.045 * rng.normal(size=fallen.shape)
        records.append(replace(record, measured=(fallen + noise)[:, None]))
    candidates = [name for name, e in model.effects.items() if e.depends_on is None]
    said = diagnose(Case(model, records, candidates), lambda known: None)
    assert said["verdict"] == [law]


def test_without_any_candidate_it_says_what_is_missing_depends_on_the_speed(
    rooms, model, tmp_path
) -> None:
    names = [name for name, e in model.effects.items() if e.depends_on is None]
    said = rooms["run"].diagnose_balls("whiffle", tmp_path, without=names)
    assert said["verdict"] == ["unknown"]
    assert said["unexplained"]["depends_on"] == "speed"
    forces = [force for (force,) in said["unexplained"]["field"]["values"]]
    assert forces[0] > forces[1] > forces[2] > forces[3]  # it brakes the more, the faster

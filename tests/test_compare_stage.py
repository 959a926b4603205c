"""The compare stage as users run it."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from robotcast.casts.action import Action
from robotcast.casts.plan import PlanLimits, plan_action
from robotcast.measurements.measurement_set import MeasurementSet, Trial
from robotcast.measurements.reader import write_measurement_set
from robotcast.simulators.simulator import SimulatedCast
from tests.simulators.conftest import CABLE, configured, nominal
from tests.stages import run_stage

ACTIONS = (Action(0.6, 0.6, -0.6, 0.65, 0.5, 1.0), Action(0.9, 0.65, -0.3, 0.7, 0.1, 0.8))
REPEATS = 3
SHIFT_M = 0.03
SHIFT_PERCENT = 100 * SHIFT_M / CABLE.length_m


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A set that the nominal simulator misses by SHIFT_M, and that simulator as a tuned one."""
    folder = tmp_path_factory.mktemp("compare")
    simulator, rng = configured("segmented"), np.random.default_rng(0)
    trials = []
    for number, action in enumerate(a for a in ACTIONS for _ in range(REPEATS)):
        planned = plan_action(action, r0_m=0.6, limits=PlanLimits())
        times_s = np.arange(0.0, planned.end_s + 1.0, 0.1)
        cast = SimulatedCast(planned.tool, times_s)
        seen_m = simulator.simulate([cast], nominal(simulator)).waypoints_m[0, 0]
        seen_m = seen_m + rng.normal(0, 0.001, seen_m.shape)
        seen_m[times_s > 0.5] += [0.0, SHIFT_M]
        trials.append(Trial(number, number // REPEATS, action, planned.tool, times_s, seen_m))
    measured = MeasurementSet(CABLE, 0.6, 0.1, None, tuple(trials), "virtual")
    write_measurement_set(measured, folder / "set")
    values = {p.name: p.nominal for p in simulator.parameters}
    write_parameters(folder / "tuned", [], values)
    shift = {"camera_offset.dx": 0.0, "camera_offset.dy": SHIFT_M}
    write_parameters(folder / "shifted", ["camera_offset"], values | shift)
    return folder


def write_parameters(folder: Path, effects: list[str], values: dict[str, float]) -> None:
    folder.mkdir()
    parameters = {name: {"value": value} for name, value in values.items()}
    plain = {"cable": vars(CABLE), "effects": effects, "parameters": parameters}
    (folder / "tuned.yaml").write_text(yaml.safe_dump(plain))


def compare(folder: Path, name: str, *settings: str) -> dict[str, Any]:
    """Run the stage; return its comparison.json."""
    output = folder / name / "out"
    given = (f"measurements={folder / 'set'}", f"output={output}", *settings)
    status, said = run_stage("compare", *given)
    assert status == 0, said
    return json.loads((output / "comparison.json").read_text())


def test_a_tuned_simulator_is_compared(folder: Path) -> None:
    found = compare(folder, "new", f"tuned={folder / 'tuned'}")
    assert found["rig"] == "virtual" and len(found["trials"]) == len(ACTIONS) * REPEATS
    assert found["final_error_percent"] == pytest.approx(SHIFT_PERCENT, rel=0.1)
    assert found["noise_floor_percent"] < 0.5
    phases = ["first arc", "reversal", "second arc", "coast", "rest"]
    assert [phase["name"] for phase in found["phases"]] == phases
    output = folder / "new" / "out"
    page = (output / "index.html").read_text()
    assert "virtual rig" in page and "too few casts to say where the error sits" in page
    assert {p.name for p in output.iterdir()} == {"comparison.json", "index.html"}


def test_an_effect_that_the_simulator_was_tuned_with_acts(folder: Path) -> None:
    found = compare(folder, "with_effect", f"tuned={folder / 'shifted'}")
    assert found["final_error_percent"] < 0.8 * SHIFT_PERCENT
    assert "with camera offset" in found["model"]


@pytest.mark.slow
def test_the_simulator_is_tuned_first_without_a_tuned_one(folder: Path) -> None:
    found = compare(folder, "fitted")
    assert found["final_error_percent"] < 0.7 * SHIFT_PERCENT
    assert "tuned to these casts" in found["model"]

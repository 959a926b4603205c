"""The compare stage as users run it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

from robotcast.casts.action import Action
from robotcast.casts.plan import PlanLimits, plan_action
from robotcast.measurements.measurement_set import Cable, MeasurementSet, Trial
from robotcast.measurements.reader import write_measurement_set
from robotcast.simulators.simulator import SimulatedCast, Simulator

ROOT = Path(__file__).resolve().parents[1]
CABLE = Cable("cable", 0.63, 0.008, 0.0045, 0.02)
ACTIONS = (
    Action(0.6, 0.6, -0.6, 0.65, 0.5, 1.0),
    Action(0.9, 0.65, -0.3, 0.7, 0.1, 0.8),
)
REPEATS = 3
SHIFT_M = 0.03


def nominal_simulator() -> Simulator:
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        return instantiate(compose("config").simulator.model, cable=CABLE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A set that the nominal simulator misses by SHIFT_M, and that simulator as a tuned one."""
    folder = tmp_path_factory.mktemp("compare")
    simulator, rng = nominal_simulator(), np.random.default_rng(0)
    vector = np.array([[p.nominal for p in simulator.parameters]])
    trials = []
    for number, action in enumerate(a for a in ACTIONS for _ in range(REPEATS)):
        planned = plan_action(action, r0_m=0.6, limits=PlanLimits())
        times_s = np.arange(0.0, planned.end_s + 1.0, 0.1)
        seen_m = simulator.simulate([SimulatedCast(planned.tool, times_s)], vector).waypoints_m[
            0, 0
        ]
        seen_m = seen_m + rng.normal(0, 0.001, seen_m.shape)
        seen_m[times_s > 0.5] += [0.0, SHIFT_M]
        trials.append(
            Trial(number, number // REPEATS, planned.action, planned.tool, times_s, seen_m)
        )
    write_measurement_set(
        MeasurementSet(CABLE, 0.6, 0.1, None, tuple(trials), "virtual"), folder / "set"
    )
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


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "stages/compare.py", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)


def test_a_tuned_simulator_is_compared(folder: Path) -> None:
    output = folder / "new" / "out"
    done = run(f"measurements={folder / 'set'}", f"tuned={folder / 'tuned'}", f"output={output}")
    assert done.returncode == 0, done.stderr
    found = json.loads((output / "comparison.json").read_text())
    assert found["rig"] == "virtual" and len(found["trials"]) == len(ACTIONS) * REPEATS
    percent = 100 * SHIFT_M / CABLE.length_m
    assert found["final_error_percent"] == pytest.approx(percent, rel=0.1)
    assert found["noise_floor_percent"] < 0.5
    assert [p["name"] for p in found["phases"]] == [
        "first arc",
        "reversal",
        "second arc",
        "coast",
        "rest",
    ]
    page = (output / "index.html").read_text()
    assert "virtual rig" in page and "too few casts to say where the error sits" in page
    assert {p.name for p in output.iterdir()} == {"comparison.json", "index.html"}


def test_an_effect_that_the_simulator_was_tuned_with_acts(folder: Path) -> None:
    output = folder / "with_effect"
    done = run(f"measurements={folder / 'set'}", f"tuned={folder / 'shifted'}", f"output={output}")
    assert done.returncode == 0, done.stderr
    found = json.loads((output / "comparison.json").read_text())
    assert found["final_error_percent"] < 0.8 * 100 * SHIFT_M / CABLE.length_m
    assert "with camera offset" in found["model"]


@pytest.mark.slow
def test_the_simulator_is_tuned_first_without_a_tuned_one(folder: Path) -> None:
    output = folder / "fitted"
    done = run(f"measurements={folder / 'set'}", f"output={output}")
    assert done.returncode == 0, done.stderr
    found = json.loads((output / "comparison.json").read_text())
    assert found["final_error_percent"] < 0.7 * 100 * SHIFT_M / CABLE.length_m
    assert "tuned to these casts" in found["model"]


def test_what_is_missing_is_named_in_one_line(folder: Path) -> None:
    for given, said in (
        ((), "measurements=DIR is needed"),
        ((f"measurements={folder / 'set'}",), "output=DIR is needed"),
        ((f"measurements={folder / 'none'}", "output=out"), "there is no such folder"),
    ):
        done = run(*given)
        assert done.returncode == 2
        assert said in " ".join(done.stderr.split())

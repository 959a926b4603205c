"""A small data folder of the shapes that the stages write, without any rig."""

import shutil
from dataclasses import asdict
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import yaml

from robotcast.casts.action import ACTION_COLUMNS, Action
from robotcast.measurements.measurement_set import Cable, MeasurementSet
from robotcast.measurements.reader import write_measurement_set
from robotcast.reporting.results import Results, read_results
from tests.good_casts import good_trial
from tests.policies.conftest import World

LENGTHS_M = {"cable1": 0.63, "cable2": 0.65, "cable3": 0.65}
WORLD = World()


@pytest.fixture(scope="session")
def data_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Measured, tuned, simulated, trained and evaluated results of three cables."""
    folder = tmp_path_factory.mktemp("results") / "data"
    for number, (cable, length_m) in enumerate(LENGTHS_M.items()):
        rng = np.random.default_rng(number)
        measured = _measured(cable, length_m, rng)
        write_measurement_set(measured, folder / "measurements" / cable)
        (folder / "measurements" / cable / "tracking.json").write_text(
            '{"casts": 61, "lost": [{"trial": 7, "reason": "hidden"}]}'
        )
        _write_tuned(folder, measured, rng)
        _write_simulated(folder / "simulated" / cable, rng)
        for dataset in ("real", "simulated", "mixed") if cable == "cable1" else ("mixed",):
            _write_policy(folder / "policies" / cable / f"nn-{dataset}", dataset)
            _write_evaluation(folder, measured, dataset, rng)
    return folder


@pytest.fixture(scope="session")
def optimizers(data_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Results in which the first cable was tuned by every optimizer."""
    folder = tmp_path_factory.mktemp("optimizers") / "data"
    shutil.copytree(data_folder, folder)
    tuned = folder / "tuned" / "cable1"
    for optimizer in ("bo", "gn"):
        path = shutil.copytree(tuned / "segmented-de", tuned / f"segmented-{optimizer}")
        facts = yaml.safe_load((path / "tuned.yaml").read_text())
        facts |= {"optimizer": optimizer, "diverged_casts": 12}
        facts["certainty"] = {"condition": 4e3, "least_known": ["a", "b"], "vague": ["a"]}
        (path / "tuned.yaml").write_text(yaml.safe_dump(facts))
    return read_results(folder)


def _measured(cable: str, length_m: float, rng) -> MeasurementSet:
    actions = WORLD.actions(50, rng)
    action_ids = np.concatenate([np.arange(50), np.arange(10)])
    details = Cable(cable, length_m, 0.03, 0.01, 0.02)
    trials = tuple(
        good_trial(trial, action_id, Action.from_array(actions[action_id]), details)
        for trial, action_id in enumerate(action_ids.tolist())
    )
    return MeasurementSet(details, 0.6, 0.1, 0.002, trials, "virtual")


def _write_tuned(data: Path, measured: MeasurementSet, rng) -> None:
    cable = measured.cable.name
    folder = data / "tuned" / cable / "segmented-de"
    folder.mkdir(parents=True)
    waypoints = pl.read_csv(data / "measurements" / cable / "waypoints.csv")
    away_m = pl.Series("away", rng.normal(0, 0.03, 30))[waypoints["trial"].clip(upper_bound=29)]
    waypoints.with_columns(
        split=pl.lit("test"), x_predicted=pl.col("x") + away_m * pl.col("t"), y_predicted="y"
    ).filter(pl.col("trial") < 30).write_parquet(folder / "predictions.parquet")
    casts = np.arange(1, 31) * 480
    best = 2 + 14 * np.exp(-casts / 3000) + rng.uniform(0, 0.2)
    pl.DataFrame({"simulated_casts": casts, "best_percent": best}).write_csv(folder / "trace.csv")
    error = {"waypoint_percent": float(best[-1] + 0.7), "final_percent": 3.1, "n_casts": 30}
    facts = {
        "simulator": "segmented",
        "optimizer": "de",
        "seed": 0,
        "rig": measured.rig,
        "cable": asdict(measured.cable),
        "simulated_casts": int(casts[-1]),
        "errors": {"tune": error, "test": error},
        "parameters": {"planar_friction": {"value": 0.5, "unit": "-", "at_bound": True}},
    }
    (folder / "tuned.yaml").write_text(yaml.safe_dump(facts))


def _write_simulated(folder: Path, rng) -> None:
    folder.mkdir(parents=True)
    actions = WORLD.actions(2500, rng)
    columns = dict(zip(ACTION_COLUMNS, actions.T, strict=True))
    ends = WORLD.endpoints(actions)
    pl.DataFrame({**columns, "x": ends[:, 0], "y": ends[:, 1]}).write_parquet(
        folder / "casts.parquet"
    )
    (folder / "generation.yaml").write_text("casts: 2500\ndiverged: 3\n")


def _write_policy(folder: Path, dataset: str) -> None:
    folder.mkdir(parents=True)
    facts = {
        "dataset": dataset,
        "seed": 0,
        "examples": {"real_casts": 30, "simulated_casts": 2500},
        "epochs": 120,
        "best_epoch": 100,
        "validation_median_m": 0.012,
    }
    (folder / "policy.yaml").write_text(yaml.safe_dump(facts))


def _write_evaluation(data: Path, measured: MeasurementSet, dataset: str, rng) -> None:
    cable = measured.cable
    far = {"real": 0.08, "simulated": 0.06, "mixed": 0.03}[dataset]
    targets = WORLD.endpoints(WORLD.actions(16, 7))
    number, repeat = (k.ravel() for k in np.indices((len(targets), 5)))
    centres = targets + rng.normal(0, far, targets.shape)
    scatter = rng.normal(0, 0.015, (len(number), 2)) @ np.array([[1.0, 0.5], [0.0, 0.6]])
    (target_x, target_y), (x, y) = targets[number].T, (centres[number] + scatter).T
    error_m = np.hypot(x - target_x, y - target_y)
    rows = {
        "target": number,
        "target_x": target_x,
        "target_y": target_y,
        "repeat": repeat,
        **dict(zip(ACTION_COLUMNS, WORLD.actions(len(number), rng).T, strict=True)),
        "predicted_x": target_x,
        "predicted_y": target_y,
        "x": x,
        "y": y,
        "error_m": error_m,
        "error_percent": 100 * error_m / cable.length_m,
    }
    names = {"kind": "executed", "rig": measured.rig, "cable": cable.name, "policy": "nn"}
    same = {**names, "dataset": dataset, "spread_x": 0.03, "spread_y": 0.02}
    folder = data / "evaluation" / cable.name / f"nn-{dataset}"
    folder.mkdir(parents=True)
    table = pl.DataFrame(rows).with_columns(**{k: pl.lit(v) for k, v in same.items()})
    table.write_csv(folder / "evaluation.csv")

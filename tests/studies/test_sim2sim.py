"""The Sim2Sim study: what a search may know, its table, the runs that are kept, and its steps."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
import yaml

from studies.sim2sim.table import HEAD, csv_text, markdown, read_outcomes, rows
from studies.sim2sim.tune import stream
from tests.test_pipeline import stages

ROOT = Path(__file__).resolve().parents[2]
MODELS = {"segmented": "ours", "hybrid": "paper"}
TOLD = pl.col("told_within_percent") <= 20.0  # as studies/sim2sim/full.yaml has it
FRICTION = {
    "simulator": "segmented", "parameters": "paper", "optimizer": "bo", "casts": 5, "model": 0,
    "start": 0, "commit": "1234567",
    "parameter": "friction", "unit": "1", "true": 0.4, "found": 0.402, "told_within_percent": 3.0,
    "tuning_percent": 0.1, "test_percent": 0.2, "simulated_casts": 2000, "diverged_casts": 1,
}  # fmt: skip
STIFFNESS = {**FRICTION, "parameter": "stiffness", "true": 2e-4, "found": 2.1e-4}
VAGUE = {
    **FRICTION, "parameter": "joint", "true": 1e-5, "found": 9e-5, "told_within_percent": 400.0,
}  # fmt: skip


@pytest.fixture
def cells(tmp_path: Path):
    """Write outcomes and return the table's rows as dicts."""

    def made(*outcomes: dict[str, Any]) -> list[dict[str, str]]:
        pl.DataFrame(outcomes).write_csv(tmp_path / "a.csv")
        return [dict(zip(HEAD, row, strict=True)) for row in rows(read_outcomes(tmp_path), 20.0)]

    return made


@pytest.mark.parametrize("number", [0, 1, 2])
@pytest.mark.parametrize("start", [0, 1])
def test_no_start_holds_numbers_of_the_model(number: int, start: int) -> None:
    model = stream(0, number, "model").random(8)
    casts = stream(0, number, "casts").random(8)
    first = stream(0, number, "start", start).random(8)
    assert len(np.unique([model, casts, first])) == 24


def test_a_stream_is_the_same_at_every_call_and_another_for_every_start() -> None:
    one, again = (stream(3, 1, "start", 1).random(4) for _ in range(2))
    np.testing.assert_array_equal(one, again)
    assert not np.isin(one, stream(3, 1, "start", 0).random(4)).any()


def test_a_parameter_that_the_casts_do_not_tell_is_left_out(cells) -> None:
    (cell,) = cells(FRICTION, STIFFNESS, VAGUE)
    assert cell["Parameters told"] == "2 of 3"
    assert cell["Parameter error [%]"] == "5"
    assert cell["Within 1 %"] == "0 of 1"


def test_each_tuning_counts_once(cells) -> None:
    again = [{**o, "start": 1, "found": o["true"]} for o in (FRICTION, STIFFNESS)]
    (cell,) = cells(FRICTION, STIFFNESS, *again)
    assert cell["Tunings"] == "2"
    assert (cell["Parameter error [%]"], cell["Worst [%]"]) == ("2.5", "5")
    assert cell["Within 1 %"] == "1 of 2"


def test_the_casts_are_those_of_the_tuning_that_took_most(cells) -> None:
    (cell,) = cells(FRICTION, {**FRICTION, "start": 1, "simulated_casts": 900})
    assert cell["Simulated casts, at most"] == "2\u202f000"


def test_a_cell_where_the_casts_tell_nothing_has_no_error(cells) -> None:
    (cell,) = cells(VAGUE)
    assert cell["Parameter error [%]"] == "–"
    assert cell["Waypoint error [%]"] == "0.2"


def test_the_papers_ranges_stand_where_it_has_them(cells) -> None:
    others = ({**FRICTION, "optimizer": name} for name in ("de", "gn"))
    paper = [cell["Paper [%]"] for cell in cells(FRICTION, *others, {**FRICTION, "casts": 20})]
    assert paper == ["1.09 to 9.25", "< 1", "–", "–"]


def test_a_folder_without_outcomes_says_what_to_run(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"run studies\.sim2sim\.tune first"):
        read_outcomes(tmp_path)


def test_the_written_forms_of_the_kept_runs_are_the_kept_ones() -> None:
    reports = ROOT / "reports/sim2sim"
    table = rows(read_outcomes(reports / "runs"), 20.0)
    assert csv_text(table) == (reports / "sim2sim.csv").read_text("utf-8")
    assert (reports / "README.md").read_text("utf-8").endswith(markdown(HEAD, table))


@pytest.mark.parametrize(("simulator", "parameters"), MODELS.items())
def test_gauss_newton_needs_a_twentieth_of_what_differential_evolution_needs(
    simulator, parameters
) -> None:
    kept = read_outcomes(ROOT / "reports/sim2sim/runs").filter(
        TOLD, simulator=simulator, parameters=parameters, casts=20
    )
    evolved, newton = (kept.filter(optimizer=name) for name in ("de", "gn"))
    assert all(len(one.unique(["model", "start"])) == 6 for one in (evolved, newton))
    assert evolved["error_percent"].to_numpy().max() < 1.0
    assert newton["error_percent"].to_numpy().max() < 0.5
    least = evolved["simulated_casts"].to_numpy().min()
    assert newton["simulated_casts"].to_numpy().max() <= least / 20


def test_bayesian_optimization_comes_as_near_with_a_twentieth_of_the_casts() -> None:
    kept = read_outcomes(ROOT / "reports/sim2sim/runs").filter(TOLD, simulator="segmented", casts=5)
    ours = kept.filter(parameters="ours").unique(["optimizer", "model", "start"])
    evolved, bayesian = (ours.filter(optimizer=name) for name in ("de", "bo"))
    error, reached = (one["test_percent"].to_numpy() for one in (bayesian, evolved))
    assert len(error) == len(reached) == 6
    assert np.median(error) <= 1.5 * np.median(reached)
    least = evolved["simulated_casts"].to_numpy().min()
    assert bayesian["simulated_casts"].to_numpy().max() <= least / 20
    of_paper = kept.filter(parameters="paper", optimizer="bo")["error_percent"].to_numpy()
    assert of_paper.max() < 1.09  # where the paper's range begins


def test_the_study_gives_every_optimizer_a_budget() -> None:
    study = yaml.safe_load((ROOT / "studies/sim2sim/full.yaml").read_text(encoding="utf-8"))
    matrix = stages("studies/sim2sim")["tune"]["matrix"]
    for model in matrix["model"]:
        budgets = study["sim2sim"]["budget_per_cast"][model["simulator"]][model["parameters"]]
        assert set(budgets) == set(matrix["optimizer"])


def run(step: str, folder: Path, *overrides: str, **environment: str) -> None:
    command = [sys.executable, "-m", f"studies.sim2sim.{step}", "--config-name", "few"]
    command += [f"sim2sim.folder={folder}", f"sim2sim.reports={folder / 'reports'}"]
    command += [f"paths.unfinished={folder / 'unfinished'}", *overrides]
    environ = os.environ | environment
    done = subprocess.run(command, cwd=ROOT, env=environ, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_gauss_newton_finds_what_twenty_casts_tell(tmp_path: Path) -> None:
    sizes = ("sim2sim.casts=20", "sim2sim.most_casts=20")
    run("tune", tmp_path, "scale=paper", "optimizer=gn", *sizes)
    outcomes = read_outcomes(tmp_path)
    told = outcomes.filter(TOLD)
    assert len(told) >= 3
    assert told["error_percent"].to_numpy().max() < 0.5
    assert "cable_mass_kg" not in outcomes["parameter"]  # weighed, so not tuned
    assert not list((tmp_path / "unfinished").glob("*"))
    run("table", tmp_path)
    assert (
        "Segmented | ours, 7 | 20 | Gauss–Newton | 1 |"
        in (tmp_path / "reports" / "README.md").read_text()
    )


@pytest.mark.slow
def test_a_search_asks_the_same_whatever_the_threads_of_linear_algebra(tmp_path: Path) -> None:
    written = []
    for threads in ("1", "2"):
        folder, sizes = tmp_path / threads, ("sim2sim.casts=10", "sim2sim.most_casts=20")
        run("tune", folder, "optimizer=gn", *sizes, OPENBLAS_NUM_THREADS=threads)
        written.append((folder / "segmented-ours-gn-10.csv").read_bytes())
    assert written[0] == written[1]

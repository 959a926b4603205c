"""The study as users run it, at a tiny size."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from robotcast.sim2sim.outcome import read_outcomes

ROOT = Path(__file__).resolve().parents[2]


def run(script: str, folder: Path, *overrides: str, **environment: str) -> None:
    command = [sys.executable, f"stages/{script}.py", "sim2sim=few", f"sim2sim.folder={folder}"]
    command += [
        f"sim2sim.reports={folder / 'reports'}",
        f"paths.unfinished={folder / 'unfinished'}",
    ]
    done = subprocess.run(
        [*command, *overrides],
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("simulator", ["segmented", "hybrid"])
def test_the_study_gives_every_optimizer_a_budget(simulator: str) -> None:
    study = yaml.safe_load((ROOT / "conf/sim2sim/full.yaml").read_text(encoding="utf-8"))
    matrix = yaml.safe_load((ROOT / "benchmarks/sim2sim/dvc.yaml").read_text(encoding="utf-8"))
    budgets = study["budget_per_cast"][simulator]
    assert set(budgets) == set(matrix["stages"]["tune"]["matrix"]["optimizer"])


@pytest.mark.slow
def test_gauss_newton_finds_what_twenty_casts_tell(tmp_path: Path) -> None:
    run(
        "sim2sim",
        tmp_path,
        "scale=paper",
        "optimizer=gn",
        "sim2sim.casts=20",
        "sim2sim.most_casts=20",
    )
    outcomes = read_outcomes(tmp_path)
    told = [o for o in outcomes if o.told_within_percent <= 20]
    assert len(told) >= 3
    for outcome in told:
        assert outcome.error_percent < 0.5
    assert "cable_mass_kg" not in [o.parameter for o in outcomes]  # weighed, so not tuned
    assert not list((tmp_path / "unfinished").glob("*"))
    run("sim2sim_table", tmp_path)
    assert "Segmented | 20 | Gauss–Newton | 1 |" in (tmp_path / "reports" / "README.md").read_text()


@pytest.mark.slow
def test_a_search_asks_the_same_whatever_the_threads_of_linear_algebra(tmp_path: Path) -> None:
    written = []
    for threads in ("1", "2"):
        folder = tmp_path / threads
        run(
            "sim2sim",
            folder,
            "optimizer=gn",
            "sim2sim.casts=10",
            "sim2sim.most_casts=20",
            OPENBLAS_NUM_THREADS=threads,
        )
        written.append((folder / "segmented-gn-10.csv").read_bytes())
    assert written[0] == written[1]

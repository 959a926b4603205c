"""benchmarks/sim2sim/dvc.yaml: every stage depends on the code it runs, and on no other."""

from pathlib import Path

import pytest
import yaml

from tests.test_pipeline import covers, reached

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = {"tune": "sim2sim.py", "table": "sim2sim_table.py"}
STAGES = yaml.safe_load((ROOT / "benchmarks/sim2sim/dvc.yaml").read_text("utf-8"))["stages"]


def test_the_stages_stand_in_order() -> None:
    assert tuple(STAGES) == tuple(SCRIPTS)


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_stage_depends_on_all_the_code_it_runs_and_on_no_other(name: str) -> None:
    deps, run = STAGES[name]["deps"], reached(STAGES[name], ROOT / "stages" / SCRIPTS[name])
    assert not sorted(file for file in run if not covers(deps, file))
    code = [dep for dep in deps if dep.startswith(("src/", "stages/"))]
    assert not [dep for dep in code if not any(covers([dep], file) for file in run)]

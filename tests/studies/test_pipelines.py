"""benchmarks/tune_size, real_casts and better_model: every stage depends on the code it runs."""

from pathlib import Path

import pytest
import yaml

from tests.test_pipeline import covers, reached

ROOT = Path(__file__).resolve().parents[2]
STUDIES = ("tune_size", "real_casts", "better_model")
STAGES = [
    (study, name, stage)
    for study in STUDIES
    for name, stage in yaml.safe_load((ROOT / f"benchmarks/{study}/dvc.yaml").read_text("utf-8"))[
        "stages"
    ].items()
]


@pytest.mark.parametrize(
    ("study", "name", "stage"), STAGES, ids=[f"{study}-{name}" for study, name, _ in STAGES]
)
def test_a_stage_depends_on_all_the_code_it_runs_and_on_no_other(study, name, stage) -> None:
    script = f"{study}_table" if name == "table" else name
    stage = stage.get("do", stage)
    run = reached(stage, ROOT / "stages" / f"{script}.py")
    deps = stage["deps"]
    assert not sorted(file for file in run if not covers(deps, file))
    code = [dep for dep in deps if dep.startswith("src/")]
    assert not [dep for dep in code if not any(covers([dep], file) for file in run)]

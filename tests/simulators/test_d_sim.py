"""D_sim: its casts begin as the measured ones did, and shards merge into the bytes of the whole."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import yaml

from robotcast.casts.action import ToolMotion
from robotcast.casts.plan import PlanLimits, plan_actions
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.reader import write_measurement_set
from robotcast.simulators import d_sim
from robotcast.simulators.simulator import Cast, Prediction, SimulatedCast, Simulator
from tests.good_casts import CABLE, good_trial, plan_cast
from tests.simulators.conftest import configured
from tests.stages import run_stage

LATE_S = 0.024
FACTS = {"simulator": "segmented", "optimizer": "de", "effects": []}
CAST = plan_cast(0.4, -0.4, 0.7, 0.5, 1.5, r0_m=0.6, limits=PlanLimits())
PLAN = partial(plan_actions, r0_m=0.6, limits=PlanLimits())


class Still(Simulator):
    """A cable that stays where it starts."""

    def __init__(self) -> None:
        self.name, self.parameters = "still", ()

    def simulate(self, casts: Sequence[Cast], vectors: np.ndarray, **_: object) -> Prediction:
        starts = [np.full(2, np.nan) if c.start_m is None else c.start_m for c in casts]
        return Prediction(np.array(starts)[None, :, None], np.zeros((1, len(casts)), dtype=bool))


def seen_at(*start_m: float) -> SimulatedCast:
    return SimulatedCast(CAST.tool, np.zeros(1), np.array(start_m))


def test_the_free_end_starts_where_resets_left_it_on_average() -> None:
    reach_m = d_sim.mean_reach([seen_at(1.22, 0.01), seen_at(1.24, -0.004)])
    assert reach_m is not None
    np.testing.assert_allclose(reach_m, [0.63, 0.003])
    actions = CAST.action.as_array()[None]
    told = d_sim.generate_casts(Still(), np.zeros(0), actions, PLAN, settle_s=1.0, reach_m=reach_m)
    np.testing.assert_allclose(told, [[1.23, 0.003]])


def test_casts_that_show_no_start_leave_it_to_the_tool() -> None:
    assert d_sim.mean_reach([SimulatedCast(CAST.tool, np.ones(1))]) is None
    actions = CAST.action.as_array()[None]
    told = d_sim.generate_casts(Still(), np.zeros(0), actions, PLAN, settle_s=1.0)
    assert np.isnan(told).all()


RANDOM = np.random.default_rng(0)
ACTIONS, ENDS = RANDOM.normal(size=(11, 6)), RANDOM.normal(size=(11, 2))
ENDS[3::5] = np.nan  # they diverged


def write_shards(folder: Path, of: int) -> list[Path]:
    folders = [folder / d_sim.shard_name(number, of) for number in range(of)]
    parts = np.array_split(ACTIONS, of), np.array_split(ENDS, of)
    for shard, actions, ends in zip(folders, *parts, strict=True):
        d_sim.write_d_sim(shard, actions, ends, {**FACTS, "subject": "one"})
    return folders


@pytest.mark.parametrize("of", [1, 3, 4])
def test_shards_merge_into_the_bytes_of_the_whole(tmp_path: Path, of: int) -> None:
    d_sim.write_d_sim(tmp_path / "whole", ACTIONS, ENDS, FACTS)
    d_sim.merge_shards(write_shards(tmp_path, of), tmp_path / "merged")
    assert_same(tmp_path / "merged", tmp_path / "whole")
    assert pl.read_parquet(tmp_path / "whole" / "casts.parquet").height == 9


def assert_same(one: Path, other: Path) -> None:
    for name in ("casts.parquet", "generation.yaml"):
        assert (one / name).read_bytes() == (other / name).read_bytes()


def test_a_missing_shard_is_named(tmp_path: Path) -> None:
    folders = write_shards(tmp_path, 3)
    (folders[1] / "generation.yaml").unlink()
    with pytest.raises(FileNotFoundError, match="1-of-3"):
        d_sim.merge_shards(folders, tmp_path / "merged")


def test_shards_of_different_simulators_do_not_merge(tmp_path: Path) -> None:
    folders = write_shards(tmp_path, 3)
    facts = yaml.safe_load((folders[2] / "generation.yaml").read_text())
    (folders[2] / "generation.yaml").write_text(yaml.safe_dump({**facts, "subject": "two"}))
    with pytest.raises(ValueError, match="come from different"):
        d_sim.merge_shards(folders, tmp_path / "merged")


def test_there_is_no_shard_beyond_the_last() -> None:
    with pytest.raises(ValueError, match="of 4 shards there is none numbered 4"):
        d_sim.shard_name(4, 4)


@pytest.mark.slow
def test_a_sweep_over_shards_gives_the_bytes_of_one_run(tmp_path: Path) -> None:
    tuned = tmp_path / "tuned"
    tuned.mkdir()
    values = {p.name: {"value": p.nominal} for p in configured("segmented").parameters}
    known = {"cable": asdict(CABLE), "parameters": values}
    (tuned / "tuned.yaml").write_text(yaml.safe_dump(known))
    write_measurement_set(measured_late(), tmp_path / "measured")
    common = [f"paths.tuned={tuned}", f"paths.shards={tmp_path / 'shards'}"]
    common += [f"paths.measurements={tmp_path / 'measured'}"]
    common += ["scale.tune.tune_casts=2", "scale.tune.test_casts=1"]
    common += ["scale.generate.grid={theta1: 3, theta2: 3, r2: 2, alpha: 2, vmax: 1}"]
    shards = ["generate.shards=3", "hydra/launcher=joblib", f"hydra.sweep.dir={tmp_path / 'jobs'}"]
    for given in (
        (f"paths.simulated={tmp_path / 'whole'}",),
        ("-m", *shards, "generate.shard=2,0,1"),
        ("generate.shards=3", f"paths.simulated={tmp_path / 'merged'}"),
    ):
        status, said = run_stage("generate", *given, *common)
        assert status == 0, said
    assert_same(tmp_path / "merged", tmp_path / "whole")
    facts = yaml.safe_load((tmp_path / "merged" / "generation.yaml").read_text())
    assert facts["arm"]["lag_s"] == pytest.approx(LATE_S, abs=1e-3)
    assert facts["reach_m"] == pytest.approx([0.63, 0.01])


def measured_late() -> MeasurementSet:
    """Casts of an arm that does what it is told `LATE_S` later."""
    trials = []
    for number, theta1 in enumerate((0.4, 0.6, 0.8)):
        planned = plan_cast(theta1, -0.4, 0.7, 0.5, 1.5, r0_m=0.6, limits=PlanLimits())
        t_s = np.arange(0.0, planned.end_s + 0.3, 0.008)
        made = ToolMotion(t_s, planned.tool.at(t_s - LATE_S))
        seen = good_trial(number, number, planned.action, CABLE, noise_m=0.0)
        laid = np.where(seen.waypoints_s[:, None] > 0, seen.waypoints_m, [1.23, 0.01])
        trials.append(replace(seen, tool=made, waypoints_m=laid))
    return MeasurementSet(CABLE, 0.6, 0.1, None, tuple(trials))

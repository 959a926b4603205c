from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import polars as pl
import pytest
from omegaconf import OmegaConf

from robotcast.build import build
from robotcast.casts.plan import PlanLimits, PlannedCast
from robotcast.rigs.virtual.cable import ArmDynamics, packaged_scatter
from robotcast.sessions import TOOL_FILE, TRUTH_FILE, VIDEO_FILE, read_record
from studies.resets.measure import resting_headings, simulate_reset
from tests.good_casts import mirrored_tool, plan_cast

pytestmark = pytest.mark.rig


def mirrored(planned: PlannedCast) -> PlannedCast:
    return replace(planned, action=planned.action.mirrored(), tool=mirrored_tool(planned.tool))


@pytest.fixture
def recorded(rig, short_cast, tmp_path) -> Path:
    rig.cast(short_cast, 3, tmp_path)
    return tmp_path


def frames(path: Path) -> int:
    return int(cv2.VideoCapture(str(path)).get(cv2.CAP_PROP_FRAME_COUNT))


def test_a_cast_leaves_its_record_its_tool_log_its_video_and_its_truth(recorded, short_cast):
    record = read_record(recorded)
    assert record.action == short_cast.action
    assert (record.rig, record.cable, record.number) == ("virtual", "cable1", 3)
    tool, truth = (pl.read_csv(recorded / name) for name in (TOOL_FILE, TRUTH_FILE))
    assert tool.columns == ["t", "x", "y", "yaw"]
    np.testing.assert_allclose(np.diff(tool["t"]), 0.008, atol=1e-9)
    assert tool["t"][0] == 0
    assert tool["t"][-1] == pytest.approx(record.rest_s, abs=0.008)
    assert frames(recorded / VIDEO_FILE) == len(truth)
    assert truth["t"][0] < 0 < record.end_s < record.rest_s < truth["t"][-1]


def test_the_same_number_gives_the_same_bytes_and_another_number_another_cast(
    rig, short_cast, recorded, tmp_path
):
    again, other = tmp_path / "again", tmp_path / "other"
    for number, folder in ((3, again), (4, other)):
        folder.mkdir()
        rig.cast(short_cast, number, folder)
    for name in (TOOL_FILE, TRUTH_FILE, VIDEO_FILE):
        assert (recorded / name).read_bytes() == (again / name).read_bytes()
        assert (recorded / name).read_bytes() != (other / name).read_bytes()


def test_a_video_of_the_rest_holds_a_few_frames_after_it(rig, short_cast, tmp_path):
    rig.cast(short_cast, 3, tmp_path, rest_only=True)
    record = read_record(tmp_path)
    assert record.rest_only
    assert record.video_t0_s == record.rest_s
    assert 2 <= frames(tmp_path / VIDEO_FILE) <= 10


def test_the_end_rests_when_the_cast_is_over(quiet_rig, short_cast):
    cable = quiet_rig.simulate_truth(short_cast, 0).cable
    last = cable.nodes_m[cable.t_s > cable.t_s[-1] - 0.15]
    assert np.ptp(last, axis=0).max() < 0.001
    assert cable.t_s[-1] > short_cast.end_s


def test_the_mirror_image_of_a_cast_is_a_cast(quiet_rig, short_cast):
    end = quiet_rig.simulate_truth(short_cast, 0).cable.end_m[-1]
    image = quiet_rig.simulate_truth(mirrored(short_cast), 0).cable.end_m[-1]
    np.testing.assert_allclose(image, end * [1, -1, 1], atol=0.001)


def test_the_arm_follows_late_by_its_lag_and_falls_short_by_its_gain_error():
    planned = plan_cast(0.6, -0.5, 0.7, 0.3, 1.2, r0_m=0.6, limits=PlanLimits())
    t_s = np.arange(0, planned.end_s + 0.5, 0.001)
    told = planned.tool.at(t_s)
    late = ArmDynamics(lag_s=0.02, gain_error=0.0).follow(planned.tool, t_s)
    shifted = planned.tool.at(t_s - 0.02)
    assert np.abs(late - shifted).max() < 0.2 * np.abs(late - told).max()
    short = ArmDynamics(gain_error=-0.01).follow(planned.tool, t_s)
    np.testing.assert_allclose(short[-1] - told[0], 0.99 * (told[-1] - told[0]), atol=1e-6)


def test_the_log_shows_what_the_arm_did_to_a_tenth_of_a_millimetre(rig, short_cast):
    truth = rig.simulate_truth(short_cast, 3)
    log = rig.log_tool(truth.tool, 3)
    wrong = log.pose - truth.tool.at(log.t_s)
    assert wrong[:, :2].std() == pytest.approx(rig.noise.tool_log_m, rel=0.2)
    assert np.abs(truth.cable.nodes_m[:, 0, :2] - truth.tool.pose[:, :2]).max() < 1e-4


def test_starts_scatter_as_the_resets_did():
    scatter = packaged_scatter("cable1")
    random = np.random.default_rng(0)
    drawn = np.array([scatter.draw(30, random) for _ in range(2000)])
    mean = np.interp((np.arange(30) + 0.5) / 30, scatter.places, scatter.headings_rad.mean(axis=0))
    np.testing.assert_allclose(drawn.mean(axis=0), mean, atol=3e-4)
    assert drawn[:, -1].std() == pytest.approx(scatter.headings_rad[:, -1].std(ddof=1), rel=0.05)


def test_a_cable_whose_resets_were_not_measured_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match=r"cable9 .known: cable1, cable2, cable3.*studies.resets"):
        packaged_scatter("cable9")


def test_the_fingerprint_changes_with_what_shapes_a_cast_and_not_with_the_workers(rig):
    made = rig.facts()["made"]
    assert replace(rig, workers=7).facts()["made"] == made
    assert replace(rig, seed=1).facts()["made"] != made
    assert replace(rig, truth=replace(rig.truth, friction=0.5)).facts()["made"] != made


CASTS = Path(__file__).parents[2] / "conf/casts/arcs.yaml"


@pytest.mark.slow
def test_the_full_reset_lays_the_cable_straight_again(rig, short_cast):
    settings = build(OmegaConf.load(CASTS).reset)
    motion = simulate_reset(rig, short_cast, 0, settings)
    assert motion.nodes_m[..., 2].max() > 0.5
    held, end = motion.nodes_m[-1, 0], motion.nodes_m[-1, -1]
    np.testing.assert_allclose(held[:2], [rig.r0_m, 0], atol=1e-4)
    assert np.linalg.norm(end - held) == pytest.approx(rig.cable.length_m, rel=0.002)
    assert np.abs(resting_headings(motion)).max() < 0.03

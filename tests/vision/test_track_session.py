from dataclasses import replace

import numpy as np
import pytest

from robotcast.measurements.reader import read_measurement_set
from robotcast.measurements.writer import write_measurement_set
from robotcast.sessions import CastRequest
from robotcast.vision.track_session import track_session
from tests.vision.conftest import ACTION


def still(t: np.ndarray) -> np.ndarray:
    return np.tile([1.2, 0.1], (len(t), 1))


@pytest.fixture
def session(lab, tmp_path):
    """Three casts of which the second was filmed without markers."""
    casts = tuple(CastRequest(number, number, ACTION) for number in (0, 1, 10000))
    session = replace(lab.session(tmp_path), casts=casts)
    for cast in casts:
        where = lab.without_markers() if cast.number == 1 else lab
        where.film(session.cast_folder(cast), where.scene(still, until_s=0.25), cast.number)
    return session


def test_a_cast_that_cannot_be_tracked_is_lost_and_the_others_go_on(session):
    reported = []

    def progress(done: int, total: int, note: str = "") -> None:
        reported.append((done, total, note))

    tracked = track_session(session, progress=progress)
    assert sorted(tracked.tracked) == [0, 10000]
    assert "cast_00001" in tracked.lost[1] and "no fiducials" in tracked.lost[1]
    assert reported[0] == (0, 3, "") and reported[-1] == (3, 3, "1 lost")
    summary = tracked.summary()
    assert summary["casts"] == 3 and summary["tracked"] == 2
    assert summary["lost"][0]["trial"] == 1
    assert 0 < summary["reprojection_px"]["median"] < 0.6


def test_the_measurement_set_can_be_written_and_read_back(session, tmp_path):
    measured = track_session(session).measurement_set(tmp_path)
    write_measurement_set(measured, tmp_path / "set")
    again = read_measurement_set(tmp_path / "set")
    assert [t.trial for t in again.trials] == [0, 10000]
    assert measured.noise_m is not None and 5e-5 < measured.noise_m < 1e-3
    np.testing.assert_allclose(again.trials[0].waypoints_m, still(np.zeros(3)), atol=0.0015)


@pytest.mark.slow
def test_two_processes_track_the_same(session):
    alone, together = track_session(session), track_session(session, workers=2)
    for number, cast in alone.tracked.items():
        np.testing.assert_array_equal(cast.xy_m, together.tracked[number].xy_m)
    assert alone.lost == together.lost


def test_a_session_in_which_nothing_can_be_tracked_says_why(session, tmp_path):
    hopeless = replace(session, casts=session.casts[1:2])
    with pytest.raises(ValueError, match=r"no cast could be tracked .*no fiducials"):
        track_session(hopeless).measurement_set(tmp_path)

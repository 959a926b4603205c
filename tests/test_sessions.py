import shutil
from pathlib import Path

import numpy as np
import pytest

from robotcast import sessions
from robotcast.casts.action import Action
from robotcast.measurements.reader import write_measurement_set
from tests.good_casts import good_set

ACTION = Action(0.5, 0.6, -0.5, 0.7, 0.2, 1.0)


@pytest.fixture
def recorded(tmp_path) -> Path:
    write_measurement_set(good_set(), tmp_path / "set")
    return tmp_path / "set"


def test_a_recorded_set_becomes_a_session_that_passes_it_on(recorded, tmp_path):
    folder = tmp_path / "session"
    sessions.adopt_recorded_set(recorded, folder)
    session, copy = sessions.read_session(folder), sessions.recorded_copy(folder)
    assert (session.rig, session.cable.name, session.casts) == ("recorded", "cable1", ())
    assert copy is not None
    assert {p.name: p.read_bytes() for p in copy.iterdir()} == {
        p.name: p.read_bytes() for p in recorded.iterdir()
    }
    (folder / "session.yaml").unlink()  # as if killed before it was written
    sessions.adopt_recorded_set(recorded, folder)
    assert sessions.read_session(folder) == session


def test_another_set_is_not_put_over_it(recorded, tmp_path):
    sessions.adopt_recorded_set(recorded, tmp_path / "session")
    other = tmp_path / "other"
    shutil.copytree(recorded, other)
    waypoints = other / "waypoints.csv"
    waypoints.write_text(waypoints.read_text().replace("1.2", "1.20", 1))
    with pytest.raises(ValueError, match=r"another recorded set .*waypoints.csv"):
        sessions.adopt_recorded_set(other, tmp_path / "session")


def test_no_set_and_a_broken_set_are_refused_before_anything_is_written(recorded, tmp_path):
    (recorded / "waypoints.csv").unlink()
    wrong = {None: r"rig\.path=DIR", tmp_path / "nowhere": "no such folder", recorded: "waypoints"}
    for path, said in wrong.items():
        with pytest.raises(ValueError, match=said):
            sessions.adopt_recorded_set(path, tmp_path / "session")
    assert not (tmp_path / "session").exists()


def test_a_folder_that_is_no_session_is_refused(tmp_path):
    with pytest.raises(ValueError, match="not a session"):
        sessions.read_session(tmp_path)


def test_action_ids_beyond_the_numbering_are_refused():
    with pytest.raises(ValueError, match="action ids"):
        sessions.number_requests([(10_000, ACTION)])


def test_frame_times_are_read_back_and_must_fit_the_video(tmp_path: Path):
    record = sessions.CastRecord(1, ACTION, "ur5", "rope", -0.1, 50.0, 0.5, 1.0, 2.0, False)
    even_s = sessions.read_frame_times(record, 0.004, 3, tmp_path)
    assert even_s == pytest.approx([-0.098, -0.078, -0.058])
    sessions.write_frame_times(np.array([np.nan, 0.1, 0.15]), tmp_path)
    assert sessions.read_frame_times(record, 0.004, 3, tmp_path)[1:] == pytest.approx([0.1, 0.15])
    with pytest.raises(ValueError, match="3 times for 4 frames"):
        sessions.read_frame_times(record, 0.004, 4, tmp_path)
    for times, line in ((np.array([1.0, 50.0, 100.0]), 4), (1.7e9 + np.arange(3.0), 2)):
        sessions.write_frame_times(times, tmp_path)
        with pytest.raises(ValueError, match=rf"frames\.csv line {line}: t is .* milliseconds"):
            sessions.read_frame_times(record, 0.004, 3, tmp_path)

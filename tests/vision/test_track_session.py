"""One bad cast is lost by name and reason, and never taken for a whole one."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from robotcast.measurements.reader import read_measurement_set, write_measurement_set
from robotcast.sessions import SESSION_FILE, VIDEO_FILE, Session, read_session, write_frame_times
from robotcast.vision.camera import BLOCK
from robotcast.vision.tracker import TrackedSession, track_session
from tests.vision.conftest import CABLE, FPS


@pytest.fixture(scope="module")
def filmed(lab, tmp_path_factory) -> Path:
    """A session of one whole cast."""
    folder = tmp_path_factory.mktemp("filmed")
    lab.cast(folder / "cast_00007", 7)
    values = {"rig": "virtual", "cable": vars(CABLE), "r0_m": 0.6, BLOCK: lab.facts.as_dict()}
    (folder / SESSION_FILE).write_text(yaml.safe_dump(values))
    return folder


@pytest.fixture
def folder(filmed: Path, tmp_path: Path) -> Path:
    """The same with a second cast, to be spoilt."""
    shutil.copytree(filmed, tmp_path / "session")
    shutil.copytree(filmed / "cast_00007", tmp_path / "session" / "cast_00008")
    request = tmp_path / "session" / "cast_00008" / "request.yaml"
    request.write_text(request.read_text().replace(": 7\n", ": 8\n"))
    return tmp_path / "session"


Change = Callable[[int, np.ndarray], np.ndarray | None]


def refilm(video: Path, change: Change) -> None:
    """Replace every frame of a video by what `change` makes of it, or leave it out."""
    reader, frames = cv2.VideoCapture(str(video)), []
    while (read := reader.read())[0]:
        frames.append(read[1])
    size = frames[0].shape[1::-1]
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"mp4v"), FPS, size)
    for number, frame in enumerate(frames):
        if (changed := change(number, frame)) is not None:
            writer.write(changed)
    writer.release()


def frames(change: Change) -> Callable[[Path], None]:
    return lambda cast: refilm(cast / VIDEO_FILE, change)


def holds(name: str, text: str) -> Callable[[Path], object]:
    return lambda cast: (cast / name).write_text(text)


def tracked(folder: Path) -> TrackedSession:
    return track_session(read_session(folder))


def test_a_session_becomes_a_set_that_is_read_back(filmed: Path, tmp_path: Path) -> None:
    found = tracked(filmed)
    assert not found.losses
    summary = found.summary()
    assert (summary["casts"], summary["tracked"], summary["lost"]) == (1, 1, [])
    assert 0 < summary["reprojection_px"]["median"] < 0.6
    measured = found.measurement_set(tmp_path / "set")
    assert measured.noise_m is not None and 5e-5 < measured.noise_m < 1e-3
    write_measurement_set(measured, tmp_path / "set")
    again = read_measurement_set(tmp_path / "set")
    assert again.notices == measured.notices == ()
    assert [(t.trial, t.rested) for t in again.trials] == [(7, True)]


def test_whatever_is_wrong_inside_a_cast_loses_that_cast(folder: Path) -> None:
    cast = folder / "cast_00008"
    text = (cast / "cast.yaml").read_text()
    (cast / "cast.yaml").write_text(text[: len(text) // 2])
    reported = []

    def progress(done: int, total: int, note: str = "") -> None:
        reported.append((done, total, note))

    found = track_session(read_session(folder), progress=progress)
    assert list(found.tracked) == [7] and "cast_00008/cast.yaml: is cut" in found.lost[8]
    assert reported[0] == (0, 2, "") and reported[-1] == (2, 2, "1 lost")


def name_a_copy(cast: Path) -> None:
    shutil.rmtree(cast)
    shutil.copytree(cast.with_name("cast_00007"), cast.with_name("cast_00007 (copy)"))


def another_rate(cast: Path) -> None:
    path = cast / "cast.yaml"
    path.write_text(path.read_text().replace("fps: 60.0", "fps: 30.0"))


def clock_again(cast: Path) -> None:
    """Give every frame its time; in the middle the camera's clock begins again."""
    reader = cv2.VideoCapture(str(cast / VIDEO_FILE))
    count = 0
    while reader.read()[0]:
        count += 1
    t_s = np.arange(count) / FPS - 0.05
    t_s[count // 2 :] -= t_s[count // 2]
    write_frame_times(t_s, cast)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (holds("request.yaml", "number: 8\n"), "request.yaml: is cut"),
        (holds("request.yaml", ""), "request.yaml: expected what collect writes"),
        (name_a_copy, r"\(copy\): holds cast_00007; a copy is no cast"),
        (
            holds("tool.csv", "t,x,y,yaw\n0,0.6,0,0\n0.008,0.6,"),
            "tool.csv line 3: y must be a finite number, got an empty cell",
        ),
        (lambda cast: (cast / "tool.csv").unlink(), "tool.csv: cannot be read"),
        (lambda cast: (cast / VIDEO_FILE).unlink(), "video.mp4: no such video"),
        (frames(lambda n, frame: frame if n == 0 else None), "only 1 frames can be read"),
        (holds(VIDEO_FILE, ""), "only 0 frames can be read"),
        (frames(lambda n, frame: 0 * frame), "cast_00008/video.mp4: no fiducials found"),
        (another_rate, "has 60 frames a second, and cast.yaml says 30"),
        (clock_again, r"frames.csv line \d+: t is 0 .* the clock began again"),
    ],
)
def test_a_bad_cast_does_not_take_the_session_along(
    folder: Path, spoil: Callable[[Path], object], said: str
) -> None:
    spoil(folder / "cast_00008")
    found = tracked(folder)
    assert list(found.tracked) == [7]
    (reason,) = found.lost.values()
    with pytest.raises(ValueError, match=said):
        raise ValueError(reason)
    assert [t.trial for t in found.measurement_set(folder / "set").trials] == [7]


def damage(cast: Path) -> None:
    """Put zeros into the middle of the film, as a memory card does."""
    data = bytearray((cast / VIDEO_FILE).read_bytes())
    data[len(data) // 2 : len(data) // 2 + 8192] = bytes(8192)
    (cast / VIDEO_FILE).write_bytes(data)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (damage, "its last frame is of t = .* and the cable came to rest at"),
        (
            frames(lambda n, frame: frame if n < 40 else None),
            "its last frame is of t = 0.60 s, and the cable came to rest at",
        ),
        (
            frames(lambda n, f: np.roll(f, 8, axis=1) if n > 42 else f),
            r"the camera was moved at t = 0.6\d s",
        ),
    ],
)
def test_half_a_film_has_waypoints_and_no_endpoint(
    folder: Path, spoil: Callable[[Path], object], said: str
) -> None:
    spoil(folder / "cast_00008")
    found = tracked(folder)
    with pytest.raises(ValueError, match=said):
        raise ValueError(found.tracked[8].unrested)
    assert len(found.losses) == 1 and "cast_00008" in found.losses[0]
    measured = found.measurement_set(folder / "set")
    assert all(f"{folder}/set/waypoints.csv: trial 8: " in notice for notice in measured.notices)
    whole, half = measured.trials
    assert whole.rested and not half.rested
    k = len(half.waypoints_s)
    assert 3 < k < len(whole.waypoints_s) / 1.5
    same = np.isin(whole.waypoints_s, half.waypoints_s)
    np.testing.assert_allclose(half.waypoints_m, whole.waypoints_m[same], atol=0.004)


def test_light_that_swings_moves_no_endpoint(folder: Path) -> None:
    def flicker(number: int, frame: np.ndarray) -> np.ndarray:
        swing = 1 - 0.25 * np.sin(2 * np.pi * number / 20) ** 2
        return np.clip(frame * swing, 0, 255).astype(np.uint8)

    refilm(folder / "cast_00008" / VIDEO_FILE, flicker)
    steady, swinging = tracked(folder).measurement_set(folder / "set").trials
    assert swinging.rested
    assert len(swinging.waypoints_s) > 0.8 * len(steady.waypoints_s)
    np.testing.assert_allclose(swinging.endpoint_m, steady.endpoint_m, atol=0.003)


def with_places(session: Session, change: dict[int, int]) -> Session:
    """Let the session say that some markers lie where others do."""
    facts = dict(session.facts[BLOCK])
    places = facts["fiducials"]["centres_m"]
    facts["fiducials"] = {
        **facts["fiducials"],
        "centres_m": [places[change.get(n, n)] for n in range(len(places))],
    }
    return replace(session, facts={BLOCK: facts})


def test_markers_in_each_others_place_are_named(filmed: Path, tmp_path: Path) -> None:
    swapped = with_places(read_session(filmed), {3: 11, 11: 3})
    with pytest.raises(ValueError, match=r"no cast .* 3 and 11 lie in each other's place"):
        track_session(swapped).measurement_set(tmp_path)
    doubled = with_places(read_session(filmed), {3: 11})
    assert "3 lies 1." in track_session(doubled).lost[7]


@pytest.mark.slow
def test_two_processes_track_the_same(folder: Path) -> None:
    (folder / "cast_00008" / VIDEO_FILE).unlink()
    alone, together = tracked(folder), track_session(read_session(folder), workers=2)
    np.testing.assert_array_equal(alone.tracked[7].xy_m, together.tracked[7].xy_m)
    assert alone.lost == together.lost

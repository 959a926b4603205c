"""The tracker against the virtual rig's truth at 1920 × 1080.

    .venv/bin/python benchmarks/tracker.py [--casts 12] [--cable cable1] [--session FOLDER]

Collects casts with the virtual rig (or takes a session that it collected), tracks their videos
on one core and compares every waypoint with where the simulated end was. A waypoint counts as
invented when the straight line from the ball's centre to the camera passes through the arm.
Exits with 1 unless the median error is ≤ 1 mm, its 99th percentile ≤ 4 mm and none is invented.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import polars as pl
from hydra import compose, initialize_config_dir

from robotcast.rigs.kinematics import Gripper, joint_path, link_points, segment_distance
from robotcast.rigs.virtual.picture import DRAWN_RADII_M
from robotcast.sessions import TOOL_FILE, TRUTH_FILE, Session, read_session, read_tool
from robotcast.vision.camera import Camera
from robotcast.vision.facts import TrackerFacts
from robotcast.vision.tracker import track_cast

ROOT = Path(__file__).resolve().parents[1]
MEDIAN_MM, WORST_MM = 1.0, 4.0
FULL_HD = ("scale.camera.width=1920", "scale.camera.height=1080")


@dataclass(frozen=True)
class Judged:
    """One tracked cast beside the truth: per waypoint, and what was seen of it."""

    misses_mm: np.ndarray
    invented: int
    gaps: int
    needless_gaps: int
    frames: int
    noise_mm: float
    seconds: float


def collect(folder: Path, cable: str, casts: int) -> None:
    """Let the collect stage record casts at full HD."""
    sizes = (*FULL_HD, f"scale.collect.casts={casts}", "scale.collect.repeats=0")
    command = [sys.executable, str(ROOT / "stages" / "collect.py"), f"cable={cable}"]
    subprocess.run([*command, *sizes, f"paths.sessions={folder}"], cwd=ROOT, check=True)


def true_camera() -> Camera:
    """Return the camera that the virtual rig films with."""
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        config = compose("config", overrides=list(FULL_HD))
    return Camera.overhead(**config.camera.lens)


def judge(folder: Path, session: Session, camera: Camera) -> Judged:
    """Track one cast and compare it with its truth.csv."""
    began = time.process_time()
    tracked = track_cast(folder, session)
    seconds = time.process_time() - began
    t, x, y = pl.read_csv(folder / TRUTH_FILE).to_numpy().T
    facts = TrackerFacts.of(session)
    wanted = np.arange(int(t[-1] / facts.period_s + 1e-9) + 1) * facts.period_s
    true = np.column_stack([np.interp(wanted, t, x), np.interp(wanted, t, y)])
    seen = np.isin(np.rint(wanted / facts.period_s), np.rint(tracked.t_s / facts.period_s))
    margin_m = arm_margin(folder, session, camera, wanted, true, facts.endpoint_height_m)
    return Judged(
        1e3 * np.linalg.norm(tracked.xy_m - true[seen], axis=1),
        int(np.sum(seen & (margin_m < 0))),
        int(np.sum(~seen)),
        int(np.sum(~seen & (margin_m > 3 * facts.endpoint_radius_m))),
        tracked.frames,
        1e3 * tracked.noise_m,
        seconds,
    )


def arm_margin(
    folder: Path,
    session: Session,
    camera: Camera,
    t_s: np.ndarray,
    end_m: np.ndarray,
    height_m: float,
) -> np.ndarray:
    """Return how far the sight lines to the free end (n, 2) pass by the arm's surface, (n,) [m]."""
    gripper = Gripper(held_height_m=session.cable.radius_m)
    tool = read_tool(folder / TOOL_FILE)
    path = type(tool)(t_s, tool.at(t_s))
    points = link_points(joint_path(path, gripper), gripper)
    eye = np.broadcast_to(camera.position_m, (len(t_s), 1, 3))
    ball = np.column_stack([end_m, np.full(len(end_m), height_m)])[:, None]
    away = segment_distance(points[:, :-1], points[:, 1:], ball, eye)
    return np.min(away - DRAWN_RADII_M, axis=1)


def report(judged: list[Judged], lost: int) -> bool:
    """Print the figures; tell whether they are good enough."""
    misses = np.concatenate([j.misses_mm for j in judged])
    median, worst = np.median(misses), np.percentile(misses, 99)
    invented = sum(j.invented for j in judged)
    frames = sum(j.frames for j in judged)
    print(f"casts tracked            {len(judged)}, lost {lost}")
    print(f"waypoints                {len(misses)}")
    print(f"median error             {median:.2f} mm (≤ {MEDIAN_MM:g})")
    print(
        f"99th percentile          {worst:.2f} mm (≤ {WORST_MM:g}), largest {misses.max():.2f} mm"
    )
    print(f"invented behind the arm  {invented} (0)")
    print(
        f"gaps                     {sum(j.gaps for j in judged)}, of which far from the arm ",
        end="",
    )
    print(sum(j.needless_gaps for j in judged))
    rms = np.sqrt(np.mean(misses**2) / 2)
    print(f"noise of a coordinate    {rms:.2f} mm true (root mean square), ", end="")
    print(f"{np.median([j.noise_mm for j in judged]):.2f} mm as the tracker estimates it")
    print(f"frames/s per core        {frames / sum(j.seconds for j in judged):.0f}")
    return bool(median <= MEDIAN_MM and worst <= WORST_MM and invented == 0)


def main() -> None:
    options = argparse.ArgumentParser(description="The tracker against the virtual rig's truth.")
    options.add_argument("--casts", type=int, default=12)
    options.add_argument("--cable", default="cable1")
    options.add_argument("--session", type=Path)
    chosen = options.parse_args()
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as scratch:
        folder = chosen.session or Path(scratch) / "session"
        if chosen.session is None:
            collect(folder, chosen.cable, chosen.casts)
        session, camera = read_session(folder), true_camera()
        judged, lost = [], 0
        for cast in session.casts:
            try:
                judged.append(judge(session.cast_folder(cast), session, camera))
            except ValueError as error:
                print(f"lost: {error}")
                lost += 1
        good = report(judged, lost)
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()

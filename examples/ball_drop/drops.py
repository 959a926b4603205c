"""The measured drops as records: how far a ball has fallen since it was let go."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
from candidates import G_M_S2
from scipy.optimize import least_squares

from robotcast.diagnosis.model import Axis, Record, Wording
from robotcast.diagnosis.repeats import TimeGrid, repeat_scatter

DATA = Path(__file__).parent / "data"
KG_PER_OZ, M_PER_CM = 0.0283495, 0.01
FIRST_M = 2.0  # of a fall tell when and where it began; air hardly matters that early

BALLS = {  # as ball_drops.csv calls them → as balls.txt does
    "Baseball": "baseball",
    "Blue Basketball": "bluebasketball",
    "Green Basketball": "greenbasketball",
    "Volleyball": "volleyball",
    "Bowling Ball": "bowlingball",
    "Golf Ball": "golfball",
    "Tennis Ball": "tennisball",
    "Whiffle Ball 1": "wiffleball1",
    "Whiffle Ball 2": "wiffleball2",
    "Yellow Whiffle Ball": "yellowWiffle",
    "Orange Whiffle Ball": "orangeWiffle",
}

WORDING = Wording(
    trial="drop",
    trials="drops",
    sample="position",
    samples="positions",
    group="release",
    groups="releases",
    mover="the ball",
    axes=(Axis("distance fallen", "m", "late in the fall", "early in the fall"),),
    factor_units={"mass": "kg", "diameter": "m", "release height": "m"},
)


def read_drops(balls: Sequence[str]) -> tuple[Record, ...]:
    """Read every drop of some balls; each is a group of its own, so it is held out as a whole."""
    if not balls:
        raise ValueError(f"no ball is called so; there are {', '.join(BALLS)}")
    table = pl.read_csv(DATA / "ball_drops.csv").with_row_index("row")
    records = []
    for ball in balls:
        factors = _mass_and_diameter(ball)
        for (drop,), rows in table.filter(ball=ball).group_by("drop", maintain_order=True):
            trial = 10 * list(BALLS).index(ball) + int(drop)
            time_s, height_m = rows["t_s"].to_numpy(), rows["height_m"].to_numpy()
            records.append(_record(trial, time_s, height_m, factors))
    return tuple(records)


def noise_floor_percent(records: Sequence[Record]) -> float | None:
    """Return how far the drops of one ball differ, in % of a metre: no model can do better."""
    repeats = [replace(record, group=record.trial // 10) for record in records]
    return repeat_scatter(repeats, TimeGrid.of(repeats), scale=1.0).sample_percent


def _mass_and_diameter(ball: str) -> dict[str, float]:
    lines = (DATA / "balls.txt").read_text(encoding="utf-8").splitlines()
    ounces, circumference_cm = next(ln.split()[1:] for ln in lines if ln.startswith(BALLS[ball]))
    if "??" in (ounces, circumference_cm):
        raise ValueError(f"balls.txt: weight and circumference of the {ball} are not known")
    return {
        "mass": float(ounces) * KG_PER_OZ,
        "diameter": float(circumference_cm) * M_PER_CM / np.pi,
    }


def _record(
    trial: int, time_s: np.ndarray, height_m: np.ndarray, factors: dict[str, float]
) -> Record:
    """Count time and distance from the release, which the start of the fall shows.

    The hand moves before it lets go, and differently each time, so the release is fitted to
    every drop's own first two metres. All models start from it, as a cast starts from the tool
    motion that was logged.
    """
    early = slice(0, int(np.argmax(height_m < height_m.max() - FIRST_M)))

    def miss(release: np.ndarray) -> np.ndarray:
        at_s, from_m = release
        return from_m - G_M_S2 / 2 * np.maximum(time_s - at_s, 0)[early] ** 2 - height_m[early]

    release_s, release_m = least_squares(miss, (0.0, height_m.max())).x
    falls = time_s >= release_s
    return Record(
        trial=trial,
        group=trial,
        times_s=time_s[falls] - release_s,
        measured=(release_m - height_m[falls])[:, None],
        factors={**factors, "release height": float(release_m)},
    )

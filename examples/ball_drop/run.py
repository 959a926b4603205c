"""Learn which effect a free fall lacks on real drops.

python examples/ball_drop/run.py [--balls WORD ...] [--output DIR]

Each WORD makes one set: the balls whose names hold it.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from candidates import SpeedField, mechanisms
from drops import BALLS, FIRST_M, WORDING, noise_floor_percent, read_drops
from free_fall import FreeFall

from robotcast.diagnosis.decision import Unexplained, strengths
from robotcast.diagnosis.diagnose import Case, diagnose
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.reporting.diagnosis_page import write_diagnosis

SETS = ("whiffle", "bowling")
ON_THE_RELEASE = (
    f"Nobody noted when a ball was let go. The release is fitted to the first {FIRST_M:g} m of "
    "every drop, as a fall without air, and all models start from it."
)


def diagnose_balls(word: str, folder: Path, without: Sequence[str] = ()) -> dict[str, Any]:
    """Diagnose the drops of the balls whose names hold `word`; write JSON and page as it goes."""
    records = read_drops([ball for ball in BALLS if word.lower() in ball.lower()])
    model = FreeFall(mechanisms())
    if unknown := [name for name in without if name not in model.effects]:
        raise ValueError(f"no effect is called {unknown[0]}; there are {', '.join(model.effects)}")
    case = Case(
        model=model,
        records=records,
        candidates=[n for n, e in model.effects.items() if not e.depends_on and n not in without],
        wording=WORDING,
        floor=noise_floor_percent(records),
        draw=_curve,
    )

    def write(known: dict[str, Any]) -> None:
        whole = {"rig": "bridge", "measurements": f"{word} balls", **known}
        write_diagnosis(folder, {**whole, "notes": [ON_THE_RELEASE, *known["notes"]]})

    return diagnose(case, write)


def _curve(inquiry: Inquiry, left: Unexplained) -> dict[str, Any]:
    """Draw a resistance that depends on the speed, as `unexplained.field` of diagnosis.json."""
    return {
        "acts_on": "the ball",
        "axes": ["speed [m/s]"],
        "unit": "m/s²",
        "points": SpeedField.at_m_s[:, None].tolist(),
        "values": (-strengths(inquiry, left))[:, None].round(3).tolist(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="Learn which effect a free fall lacks.")
    parser.add_argument("--balls", nargs="+", default=SETS, metavar="WORD")
    parser.add_argument("--without", nargs="+", default=(), metavar="EFFECT")
    parser.add_argument("--output", type=Path, default=Path("outputs/ball_drop"), metavar="DIR")
    given = parser.parse_args()
    try:
        for word in given.balls:
            folder = given.output / word.lower().replace(" ", "_")
            print(f"{word}: {_summary(diagnose_balls(word, folder, given.without))}")
            print(f"  open {folder / 'index.html'}")
    except ValueError as error:
        sys.exit(f"ball_drop: {error}")


def _summary(said: dict[str, Any]) -> str:
    """Say the verdict and the errors [m]."""
    floor = f"noise floor {said['noise_floor_percent'] / 100:.2f} m"
    if not said["conclusive"]:
        fitted = said["comparison"]["waypoint_error_percent"] / 100
        return f"{said['sentence']} Free fall misses them by {fitted:.2f} m ({floor})."
    errors = [rung["heldout_waypoint_error_percent"] / 100 for rung in said["ladder"]]
    fall = " → ".join(f"{error:.2f} m" for error in errors)
    return f"{' + '.join(said['verdict'])}; held-out error {fall} ({floor})"


if __name__ == "__main__":
    main()

"""Put the error against the number of real casts into one table and figure."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import yaml
from matplotlib.figure import Figure
from omegaconf import DictConfig

from robotcast.files import write_text
from robotcast.reporting.names import math_text, name_of, policy_name
from robotcast.reporting.page import markdown
from robotcast.reporting.results import read_evaluation
from robotcast.reporting.style import BLUE, VERMILION, log_marks, style, svg
from robotcast.stage import output_folder, stage, tell
from studies.points import HEAD, Point

TEXT = """# What real casts are worth

Policies that learned from so many real casts, tested on the same targets of the virtual rig.
D_sim is the same for all: its simulator was tuned to 20 casts. The paper learned π_RD from over
500 casts and found π_SD, which had seen 20, as good. Median with the 95 % interval of a
bootstrap over targets, quartiles, and scatter: the median distance of the repeats of a cast from
their mean, in % of cable length. Every point is one training and one draw of casts: its interval
knows nothing of others. Made by `make real-casts`.

![Median error against the number of real casts](errors.svg)

"""


def errors_figure(points: Sequence[Point]) -> Figure:
    """Draw the median error with its interval against the number of real casts."""
    figure = Figure(figsize=(6.0, 3.6))
    axes = figure.subplots()
    for group, color in zip(sorted({p.group for p in points}), (BLUE, VERMILION), strict=False):
        of = sorted((p for p in points if p.group == group), key=lambda p: p.place)
        numbers = np.array([p.numbers for p in of])
        places = [p.place for p in of]
        name = f"{policy_name('nn', group)} on {name_of(group)}"
        axes.plot(places, numbers[:, 0], "o-", color=color, label=math_text(name))
        axes.vlines(places, numbers[:, 1], numbers[:, 2], color=color, lw=1.2)
    axes.set_xscale("log")
    log_marks(axes.xaxis, sorted({p.place for p in points}))
    axes.set_ylim(bottom=0)
    axes.set(xlabel="real casts to learn from", ylabel="median error\n[% of cable length]")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def table(config: DictConfig) -> None:
    settings = config.study
    points = []
    for path in sorted(Path(settings.folder).glob("evaluation/*/evaluation.csv")):
        evaluation = read_evaluation(path)
        told = Path(settings.folder) / "policies" / path.parent.name / "policy.yaml"
        casts = yaml.safe_load(told.read_text(encoding="utf-8"))["examples"]["real_casts"]
        points.append(Point(evaluation.dataset, casts, evaluation))
    if not points:
        raise ValueError(f"{settings.folder} holds no evaluation: run the study's other stages")
    points.sort(key=lambda p: (p.group, p.place))
    rows = [
        (policy_name("nn", p.group), name_of(p.group), int(p.place), *p.numbers) for p in points
    ]
    columns = ("Policy", "Dataset", "Real casts", *HEAD)
    folder = output_folder(settings.reports)
    write_text(folder / "README.md", TEXT + markdown(columns, rows))
    with style():
        write_text(folder / "errors.svg", svg(errors_figure(points)))
    tell(f"{folder}: {len(rows)} policies")


if __name__ == "__main__":
    stage(table)()

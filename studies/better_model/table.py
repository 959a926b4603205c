"""Put the error ladders of the model and of its policies side by side."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure
from omegaconf import DictConfig

from robotcast.files import write_text
from robotcast.reporting.names import effect_name, math_text, policy_name
from robotcast.reporting.page import markdown
from robotcast.reporting.results import read_evaluation
from robotcast.reporting.style import Bar, Row, bars, svg
from robotcast.stage import output_folder, stage, tell
from robotcast.tuning.tuned import REVISION
from studies.points import HEAD, Point, change

TEXT = """# What a better model is worth to a policy

The virtual rig hides an effect here: its board is not level. The base model was tuned to its
casts without knowing; the diagnosed one with the effects that the diagnosis named: {effects}.
Each generated its D_sim, and the policies learned from them were tested on the same targets, as
often. Model: average waypoint error on the same held-out casts. Policies: median distance to the
target with the 95 % interval of a bootstrap over targets, quartiles, and scatter: the median
distance of the repeats of a cast from their mean. In % of cable length. Made by
`make better-model`.

![Both error ladders](ladders.svg)

"""
CHANGES = """
From the base model to the diagnosed one, over the targets at which casts of both were tracked, with
the 95 % interval of a bootstrap that draws the same targets for both:

"""
MODELS = ("base", "diagnosed")
CHANGE_HEAD = ("Policy", "its median error", "from", "to")


def change_rows(points: Sequence[Point]) -> list[tuple[str, str, str, str]]:
    """Return `CHANGE_HEAD` for every group: from its first place to its last, with the interval."""
    rows = []
    for group in dict.fromkeys(p.group for p in points):
        of = sorted((p for p in points if p.group == group), key=lambda p: p.place)
        if len(of) > 1:
            found = change(of[0].evaluation, of[-1].evaluation)
            rows.append((policy_name("nn", group), *(f"{100 * share:+.0f} %" for share in found)))
    return rows


def ladder_figure(models: Mapping[str, float], points: Sequence[Point]) -> Figure:
    """Draw the models' errors on held-out casts, by name [%], above their policies' at targets."""
    rows = []
    for place, (model, error) in enumerate(models.items()):
        drawn = [Bar(error, "before", "model")]
        for p in sorted((p for p in points if p.place == place), key=lambda p: p.group):
            median, low, high = p.numbers[:3]
            name = math_text(policy_name("nn", p.group))
            drawn.append(Bar(median, note=name, interval=(low, high)))
        rows.append(Row(f"{model} model", tuple(drawn)))
    return bars(rows, "error [% of cable length]")


def table(config: DictConfig) -> None:
    settings = config.study
    folder = Path(settings.folder)
    revisions = {m: json.loads((folder / "tuned" / m / REVISION).read_text()) for m in MODELS}
    models = {m: float(r["heldout_waypoint_error_percent"]) for m, r in revisions.items()}
    points = [
        Point(dataset, place, read_evaluation(path))
        for place, model in enumerate(MODELS)
        for dataset in ("simulated", "mixed")
        if (path := folder / "evaluation" / f"{model}-{dataset}" / "evaluation.csv").exists()
    ]
    if not points:
        raise ValueError(f"{folder} holds no evaluation: run the study's other stages")
    rows = []
    for p in points:
        model = MODELS[int(p.place)]
        rows.append((model, models[model], policy_name("nn", p.group), *p.numbers))
    effects = ", ".join(map(effect_name, revisions["diagnosed"]["effects"])) or "none"
    reports = output_folder(settings.reports)
    written = markdown(("Model", "its error", "Policy", *HEAD), rows)
    changes = markdown(CHANGE_HEAD, change_rows(points))
    text = TEXT.format(effects=effects) + written + CHANGES + changes
    write_text(reports / "README.md", text)
    write_text(reports / "ladders.svg", svg(ladder_figure(models, points)))
    tell(f"{reports}: {len(rows)} policies")


if __name__ == "__main__":
    stage(table)()

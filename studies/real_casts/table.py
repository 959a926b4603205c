"""Put the error against the number of real casts into one table and figure."""

from pathlib import Path

import yaml
from omegaconf import DictConfig

from robotcast.files import write_text
from robotcast.reporting.names import dataset_name, policy_name
from robotcast.reporting.results import read_evaluation
from robotcast.reporting.studies import HEAD, Point, markdown, real_casts_figure
from robotcast.reporting.style import style, svg
from robotcast.stage import output_folder, stage, tell

TEXT = """# What real casts are worth

Policies that learned from so many real casts, tested on the same targets of the virtual rig.
D_sim is the same for all: its simulator was tuned to 20 casts. The paper learned π_RD from over
500 casts and found π_SD, which had seen 20, as good. Median with the 95 % interval of a
bootstrap over targets, quartiles, and scatter: the median distance of the repeats of a cast from
their mean, in % of cable length. Every point is one training and one draw of casts: its interval
knows nothing of others. Made by `make real-casts`.

![Median error against the number of real casts](errors.svg)

"""


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
        (policy_name("nn", p.group), dataset_name(p.group), int(p.place), *p.numbers)
        for p in points
    ]
    columns = ("Policy", "Dataset", "Real casts", *HEAD)
    folder = output_folder(settings.reports)
    write_text(folder / "README.md", TEXT + markdown(columns, rows))
    with style():
        write_text(folder / "errors.svg", svg(real_casts_figure(points)).decode("utf-8"))
    tell(f"{folder}: {len(rows)} policies")


if __name__ == "__main__":
    stage(table)()

"""Put what more casts to tune to are worth into one table."""

from pathlib import Path

from omegaconf import DictConfig

from robotcast.files import write_text
from robotcast.reporting.names import cable_name, rig_names
from robotcast.reporting.results import read_tuning
from robotcast.reporting.studies import SIZE_HEAD, markdown, size_rows
from robotcast.stage import output_folder, stage, tell

TEXT = """# How many casts to tune to?

Simulators tuned by differential evolution to casts of {cable}, {rig}, and judged on the same
held-out ones. The fewer casts are among the more; both searches have as many generations, so that
one on three times the casts simulates three times as many. Change: of the held-out waypoint error
against the fewest casts, cast by cast, with its 95 % bootstrap interval over casts. Errors in % of
cable length. The paper saw a negligible difference between 20 and 60 casts. Made by
`make tune-size`.

"""


def table(config: DictConfig) -> None:
    settings = config.study
    tunings = [read_tuning(p) for p in sorted(Path(settings.folder).glob("*/tuned.yaml"))]
    if not tunings:
        raise ValueError(f"{settings.folder} holds no tuned simulator: run the study's tunings")
    cable, rigs = tunings[0].cable, tuple(sorted({t.facts["rig"] for t in tunings}))
    text = TEXT.format(cable=cable_name(cable), rig=rig_names(rigs))
    rows = size_rows(tunings)
    folder = output_folder(settings.reports)
    write_text(folder / "README.md", text + markdown(SIZE_HEAD, rows))
    tell(f"{folder}: {len(rows)} tunings")


if __name__ == "__main__":
    stage(table)()

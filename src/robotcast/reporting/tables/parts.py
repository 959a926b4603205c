"""Table "parts": what the error of each policy is made of."""

import numpy as np

from robotcast.reporting.names import cable_name, dataset_name, policy_name
from robotcast.reporting.paper import POLICIES
from robotcast.reporting.results import Evaluation, Results
from robotcast.reporting.table import Cell, Group, Row, Table
from robotcast.reporting.tables.cells import median_and_repeats, shares
from robotcast.reporting.tables.setting import setting


def parts_table(results: Results) -> Table:
    """What every policy's error is made of, how sure its median is, what its model expects."""
    shown = [e for e in _ordered(results) if len(e.errors_percent)]
    rows = []
    for evaluation in shown:
        parts = evaluation.parts
        cells = (
            Cell(float(np.median(evaluation.errors_percent))),
            *median_and_repeats(evaluation),
            Cell(parts.repeatability if parts else None),
            Cell(parts.model if parts else None),
            *shares(evaluation),
            Cell(evaluation.expected_percent),
            Cell(_hundred(evaluation.within_expected)),
        )
        labels = (
            cable_name(evaluation.cable),
            policy_name(evaluation.policy, evaluation.dataset),
            dataset_name(evaluation.dataset),
        )
        rows.append(Row(labels, cells))
    return Table(
        name="parts",
        caption=(
            f"What the error of each policy is made of, {setting(shown)}. The 95 % interval of "
            "the median is a bootstrap over targets; the scatter is the median distance of "
            "repeats from their mean. Root mean squares: repeatability (aleatoric) is the scatter "
            "of repeats, model (epistemic) the distance of their mean from the target; the shares "
            "are their parts of the mean square error. Expected is how far from its "
            "prediction the model expects a cast to end (root mean square), covered the share of "
            "casts that ended where it expects 95 %. In % of cable length but the shares."
        ),
        label_columns=("Cable", "Model", "Dataset"),
        groups=(
            Group("Median", ("Median", "from", "to")),
            Group("Repeats", ("Scatter",)),
            Group("Root mean square", ("Repeatability", "Model")),
            Group("Share", ("Aleatoric", "Epistemic")),
            Group("Model’s spread", ("Expected", "Covered")),
        ),
        rows=tuple(rows),
        reference=4,
    )


def _hundred(share: float | None) -> float | None:
    return None if share is None else 100 * share


def _ordered(results: Results) -> list[Evaluation]:
    """Evaluations by cable, then as the paper lists policies."""
    paper = [*POLICIES]

    def place(evaluation: Evaluation) -> tuple:
        pair = (evaluation.policy, evaluation.dataset)
        return (evaluation.cable, paper.index(pair) if pair in paper else len(paper), pair)

    return sorted(results.evaluations, key=place)

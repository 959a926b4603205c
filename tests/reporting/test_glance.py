from dataclasses import replace

from robotcast.reporting.glance import glance_of
from robotcast.reporting.results import read_results


def test_it_names_the_policy_with_the_lowest_median(data_folder) -> None:
    results = read_results(data_folder)
    mixed = results.evaluation("cable2", "nn", "mixed")
    assert mixed is not None
    halved = mixed.casts.with_columns(mixed.casts["error_percent"] / 2)
    better = replace(mixed, policy="residual", casts=halved)
    glance = glance_of(replace(results, evaluations=(*results.evaluations, better)))
    row = dict(zip(glance.columns, glance.rows[1], strict=True))
    assert row["Cable"] == "Cable 2"
    assert row["π_R2S2R median"] == f"{mixed.median_percent:.1f}%"
    assert row["Best policy median"] == f"Residual {better.median_percent:.1f}%"
    assert row["Its repeats scatter"] == f"{better.scatter_percent:.1f}%"


def test_a_cable_without_casts_on_a_rig_has_no_best_policy(data_folder) -> None:
    results = read_results(data_folder)
    predicted = tuple(replace(e, kind="predicted") for e in results.evaluations)
    glance = glance_of(replace(results, evaluations=predicted))
    row = dict(zip(glance.columns, glance.rows[0], strict=True))
    assert row["Best policy median"] == row["Its repeats scatter"] == "–"

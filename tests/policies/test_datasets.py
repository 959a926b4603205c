from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from robotcast.policies.datasets import (
    Dataset,
    folds,
    mixed_dataset,
    read_simulated,
    real_dataset,
    simulated_dataset,
)


def rows(examples) -> set[bytes]:
    return {row.tobytes() for row in examples.actions}


def kept(dataset: Dataset) -> set[bytes]:
    return rows(dataset.training) | rows(dataset.validation)


@pytest.fixture(scope="module")
def real(world) -> Dataset:
    return world.real()


@pytest.fixture(scope="module")
def mixed(real, simulated) -> Dataset:
    return mixed_dataset(real, simulated, real_fraction=0.35, real_weight=2.0, seed=0)


def test_repeats_of_an_action_never_stand_on_both_sides(real) -> None:
    assert not rows(real.training) & rows(real.validation)
    assert len(real.training) + len(real.validation) == 36


def test_test_casts_are_left_out_of_d_real(world) -> None:
    measured = world.measured()
    dataset = real_dataset(measured, range(10), validation_fraction=0.2, seed=0)
    left_out = {t.action.as_array().tobytes() for t in measured.trials[6:10]}
    assert not left_out & kept(dataset)
    assert dataset.facts == {"cable": "made up", "real_casts": 26, "left_out_casts": 10}


@pytest.mark.parametrize(
    ("left_out", "casts", "said"),
    [
        (range(36), None, "no cast that was seen at rest is left"),
        ([], 100, "asked for 100 casts, 36 are to be had"),
    ],
)
def test_d_real_of_casts_that_are_not_there_is_refused(world, left_out, casts, said) -> None:
    with pytest.raises(ValueError, match=said):
        real_dataset(world.measured(), left_out, validation_fraction=0.2, seed=0, casts=casts)


@pytest.mark.parametrize("fraction", [0.3, 0.4])
def test_real_data_make_the_wanted_part_of_the_mixture(real, simulated, fraction) -> None:
    mixed = mixed_dataset(real, simulated, real_fraction=fraction, real_weight=3.0, seed=0)
    is_real = np.array([row.tobytes() in rows(real.training) for row in mixed.training.actions])
    assert is_real.mean() == pytest.approx(fraction, abs=0.002)
    assert set(mixed.training.weights[is_real]) == {3.0}
    assert set(mixed.training.weights[~is_real]) == {1.0}


def test_upsampling_keeps_every_real_cast_and_no_validation_cast(real, mixed) -> None:
    assert rows(real.training) <= rows(mixed.training)
    assert not rows(mixed.training) & rows(mixed.validation)


def test_validation_weighs_real_casts_as_training_does(real, mixed) -> None:
    def real_share(examples) -> float:
        is_real = np.array([row.tobytes() in kept(real) for row in examples.actions])
        return examples.weights[is_real].sum() / examples.weights.sum()

    assert real_share(mixed.validation) == pytest.approx(real_share(mixed.training), rel=1e-6)


def test_a_real_part_already_larger_is_not_cut(real, simulated) -> None:
    mixed = mixed_dataset(real, simulated, real_fraction=0.01, real_weight=1.0, seed=0)
    assert len(mixed.training) == len(simulated.training) + len(real.training)


def test_the_same_seed_gives_the_same_mixture(real, simulated, mixed) -> None:
    again = mixed_dataset(real, simulated, real_fraction=0.35, real_weight=2.0, seed=0)
    assert again.training.actions.tobytes() == mixed.training.actions.tobytes()


def test_missing_d_sim_says_which_stage_makes_it(tmp_path) -> None:
    with pytest.raises(FileNotFoundError, match="run the generate stage"):
        read_simulated(tmp_path / "casts.parquet")


@pytest.mark.parametrize(("fraction", "weight"), [(0.0, 1.0), (1.0, 1.0), (0.35, 0.0)])
def test_a_mixture_that_cannot_be_is_refused(real, simulated, fraction, weight) -> None:
    with pytest.raises(ValueError, match="dataset mixed: real_"):
        mixed_dataset(real, simulated, real_fraction=fraction, real_weight=weight, seed=0)


def test_casts_of_two_cables_do_not_mix(real, simulated) -> None:
    other = replace(simulated, facts={**simulated.facts, "cable": "cable2"})
    with pytest.raises(ValueError, match="casts of cable2 and made up do not mix"):
        mixed_dataset(real, other, real_fraction=0.35, real_weight=2.0, seed=0)


def test_an_endpoint_that_is_not_a_number_is_refused_with_its_trial(world) -> None:
    measured = world.measured()
    bad = replace(measured.trials[4], waypoints_m=np.array([[np.nan, 0.1]]))
    trials = (*measured.trials[:4], bad, *measured.trials[5:])
    with pytest.raises(ValueError, match="trial 4 is not finite"):
        real_dataset(replace(measured, trials=trials), [], validation_fraction=0.2, seed=0)


def test_a_simulated_endpoint_that_is_not_a_number_is_refused_with_its_row(world, tmp_path) -> None:
    world.write_simulated(path := tmp_path / "casts.parquet")
    seventh = pl.int_range(pl.len()) == 7
    table = pl.read_parquet(path).with_columns(pl.when(~seventh).then("x").otherwise(np.nan))
    table.write_parquet(path)
    with pytest.raises(ValueError, match="row 7 is not finite"):
        simulated_dataset(path, validation_fraction=0.1, seed=0)


def test_five_casts_make_a_dataset_and_one_action_does_not(world) -> None:
    five = world.real(5, 0, 0.15)
    assert (len(five.training), len(five.validation)) == (4, 1)
    with pytest.raises(ValueError, match="at least 2 different actions"):
        world.real(1, 1, 0.15)


def test_fewer_real_casts_are_contained_in_more(world) -> None:
    measured = world.measured()
    few, more = (
        real_dataset(measured, [], validation_fraction=0.2, seed=0, casts=n) for n in (10, 25)
    )
    assert few.facts["real_casts"] == 10
    assert kept(few) <= kept(more)


def test_duplicates_are_merged_into_their_weight(real) -> None:
    twice = real.training.joined(real.training.weighted(2.0)).merged()
    assert rows(twice) == rows(real.training)
    assert twice.weights.sum() == pytest.approx(3 * real.training.weights.sum())


def test_casts_that_come_first_are_in_the_fewest(world) -> None:
    measured = world.measured()
    first = [t.trial for t in measured.trials[20:26]]
    few = real_dataset(measured, [], validation_fraction=0.2, seed=0, casts=6, first=first)
    asked = np.stack([measured.trials[number].action.as_array() for number in first])
    assert kept(few) == {row.tobytes() for row in asked}


def test_folds_hold_out_every_real_cast_once_and_repeats_together(real) -> None:
    parts = list(folds(real, 3, seed=0))
    assert sum(len(out) for _, out in parts) == len(real.training) + len(real.validation)
    assert set.union(*(rows(out) for _, out in parts)) == kept(real)
    for rest, out in parts:
        assert not rows(out) & kept(rest)
        assert not rows(rest.training) & rows(rest.validation)


def test_two_real_actions_have_no_folds(world) -> None:
    assert list(folds(world.real(2, 0, 0.5), 3, seed=0)) == []


def test_the_spread_is_set_on_measured_casts_where_there_are_any(real, simulated, mixed) -> None:
    assert rows(mixed.calibration) == rows(real.validation)
    assert rows(simulated.calibration) == rows(simulated.validation)

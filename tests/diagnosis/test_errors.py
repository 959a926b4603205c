"""How large errors are, and when one model's are smaller beyond luck and by what matters."""

import numpy as np
import pytest

from robotcast.diagnosis.errors import Floor, Gain, Scales, misses, typical, worse
from robotcast.diagnosis.repeats import RepeatScatter
from robotcast.diagnosis.rule import Rule

GROUPS = np.arange(40)
RULE = Rule()
WHIP = ([1.0, 1.2, 0.9], [0.8, 1.1, 1.0], [10.0, 12.0, 2.0])


def scatter(*groups: list[float]) -> RepeatScatter:
    deviations = tuple(np.array(group) for group in groups)
    return RepeatScatter(
        1.0, 1.0, np.empty(0), np.empty(0), deviations, len(groups), 3 * len(groups)
    )


def errors(level: float, seed: int) -> np.ndarray:
    """Return average errors of 40 trials [% of the scale]."""
    return level * np.exp(0.2 * np.random.default_rng(seed).normal(size=len(GROUPS)))


def scales(base: float, usual: np.ndarray | None = None, floor: Floor | None = None) -> Scales:
    everyone = np.ones(40, bool) if usual is None else usual
    return Scales(floor or Floor(None, 0.5, 0.0), base, GROUPS, everyone, RULE)


STEP, SENSORS = Floor.known(1.0, 0.1, numerical=0.9), Floor.known(1.0, 0.1, is_least=True)


@pytest.mark.parametrize(
    ("base", "floor", "before", "after", "pays"),
    [
        (2.0, None, 2.0, 0.6, True),
        (2.0, None, 2.0, 2.0, False),
        (0.9, None, 0.9, 0.6, True),
        (4.0, None, 0.9, 0.6, False),  # saved late: little beside what was missed at first
        (4.0, Floor.known(0.25, 0.1), 0.9, 0.5, True),  # but most of the rest, far above the floor
        (1.2, STEP, 1.2, 0.1, False),  # makes up for the model's own step
        (1.2, STEP, 2.5, 0.1, True),
        (0.9, SENSORS, 0.9, 0.6, False),  # below what sensors leave, only half of it matters
        (0.9, SENSORS, 0.9, 0.2, True),
    ],
)
def test_a_saving_pays_where_it_matters(base, floor, before, after, pays) -> None:
    gain = scales(base, floor=floor).gain(errors(before, 0), errors(after, 1))
    assert gain.pays(RULE, 20 if pays else 1) is pays
    assert floor or gain.share == pytest.approx((before - after) / base, abs=0.05)


def test_a_sure_but_small_saving_does_not_matter() -> None:
    small = scales(2.0).gain(errors(2.0, 0), 0.95 * errors(2.0, 0))
    assert small.p_value < 1e-3
    assert not small.pays(RULE, 1) and not small.promises(RULE)


def test_near_the_floor_what_takes_away_most_of_the_rest_only_promises() -> None:
    above, at = (scales(4.0, floor=Floor.known(f, 0.1)) for f in (0.5, 0.7))
    most, little = (above.gain(errors(0.9, 0), errors(to, 1)) for to in (0.6, 0.8))
    assert most.promises(RULE) and not most.pays(RULE, 20) and not little.promises(RULE)
    assert not at.gain(errors(0.9, 0), errors(0.7, 1)).promises(RULE)  # it is at the floor


def test_every_further_comparison_asks_for_more_but_twelve_groups_can_reach_it() -> None:
    """Friction that cut the error of twelve groups threefold was once lost to a fixed level."""
    gain = Gain(share=0.5, rest=0.0, p_value=0.01)
    assert gain.pays(RULE, 4) and not gain.pays(RULE, 20) and gain.promises(RULE)
    saved = 1.0 + 0.9 * np.random.default_rng(0).normal(size=12)
    assert worse(saved, np.arange(12), RULE.far) < RULE.level / 10


def test_wrongly_measured_trials_decide_nothing() -> None:
    before, after = errors(2.0, 0), errors(2.0, 0)
    after[3] = 200.0
    usual = np.arange(40) != 3
    gain = scales(2.0, usual).gain(before, after)
    assert gain.share == pytest.approx(0.0, abs=1e-9)


def test_one_diverged_trial_does_not_hide_what_all_others_save() -> None:
    saved = np.full(40, 0.5) + 0.1 * np.random.default_rng(0).normal(size=40)
    saved[7] = -50.0
    assert worse(saved, GROUPS, RULE.far) < 1e-3


def test_a_few_whip_like_trials_hardly_move_the_typical_error_and_the_floor() -> None:
    calm = errors(1.0, 0)
    whip = np.where(GROUPS < 2, 30.0, calm)
    assert typical(misses(whip, 0.5), 0.5) < 1.3 * typical(misses(calm, 0.5), 0.5)
    assert whip.mean() > 2 * calm.mean()
    without = Floor.of(scatter(*WHIP[:2], [1.0, 1.0, 1.1]), 0.3)
    assert Floor.of(scatter(*WHIP), 0.3).unit == pytest.approx(without.unit, rel=0.1)


def test_a_model_that_misses_like_repeats_is_at_the_floor() -> None:
    deviations = np.concatenate(WHIP)
    measured, told = Floor.of(scatter(*WHIP), 0.3), Floor.known(2.0, 0.3)
    assert not measured.above(deviations, 1.2) and measured.above(1.5 * deviations, 1.2)
    assert not told.above(np.full(5, 2.9), 1.5) and told.above(np.full(5, 3.1), 1.5)
    unknown = Floor.of(RepeatScatter(None, None, np.empty(0), np.empty(0), (), 0, 0), 0.3)
    assert unknown.percent is None and not unknown.above(np.full(3, 100.0), 1.5)

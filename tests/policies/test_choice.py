import numpy as np
import pytest

from robotcast.policies.choosing.choice import choose_actions


def test_without_caution_the_candidate_predicted_nearest_to_the_target_is_chosen(world) -> None:
    candidates = world.actions(300)
    predicted = world.predict(candidates)
    targets = np.array([[0.8, -0.5], [1.0, -0.3]])
    choices = choose_actions(world, candidates, targets, caution=0)
    for target, choice in zip(targets, choices, strict=True):
        nearest = np.linalg.norm(predicted - target, axis=1).min()
        assert np.linalg.norm(choice.predicted_m - target) == pytest.approx(nearest)
        assert world.predict(choice.action.as_array()[None])[0] == pytest.approx(choice.predicted_m)


class Uneven:
    """Knows the world, and says of every action by itself how far casts scatter about it."""

    def __init__(self, world, least_m: float, most_m: float) -> None:
        self.predict, self._range, self.asked = world.predict, (least_m, most_m), 0

    def spread(self, actions: np.ndarray) -> np.ndarray:
        self.asked += len(actions)
        part = np.sin(1e4 * actions.sum(axis=1)) ** 2
        return np.interp(part, [0, 1], self._range)[:, None] * [1.0, 0.5]


@pytest.mark.parametrize("most_m", [0.0, 0.05, 0.5, 5.0])
def test_the_least_expected_miss_of_all_candidates_is_chosen(world, most_m: float) -> None:
    model, candidates = Uneven(world, 0.0, most_m), world.actions(3000)
    targets = np.array([[0.8, -0.5], [1.0, -0.3], [0.9, 0.4], [2.5, -0.2]])
    choices = choose_actions(model, candidates, targets, caution=2.0)
    scatter = 2.0 * np.square(model.spread(candidates)).sum(axis=1)
    for (x, y), choice in zip(targets, choices, strict=True):
        away = np.square(world.predict(candidates) - [x, -abs(y)]).sum(axis=1)
        chosen = choice.action if y < 0 else choice.action.mirrored()
        np.testing.assert_allclose(chosen.as_array(), candidates[(away + scatter).argmin()])


def test_only_candidates_that_a_target_may_want_are_asked_for_their_spread(world) -> None:
    model, candidates = Uneven(world, 0.01, 0.05), world.actions(3000)
    choose_actions(model, candidates, np.array([[0.8, -0.5], [1.0, -0.3]]))
    assert model.asked < 300


def test_a_target_on_the_other_side_gets_the_mirror_cast(world) -> None:
    candidates = world.actions(300)
    right, left = choose_actions(world, candidates, np.array([[0.8, -0.5], [0.8, 0.5]]))
    assert left.action == right.action.mirrored()
    assert left.predicted_m == pytest.approx(right.predicted_m * [1, -1])


def test_candidates_are_predicted_once_for_all_targets(world) -> None:
    class Counting:
        calls = 0

        def predict(self, actions):
            self.calls += 1
            return world.predict(actions)

        def spread(self, actions):
            return world.spread(actions)

    model = Counting()
    choose_actions(model, world.actions(50), np.tile([0.8, -0.5], (16, 1)))
    assert model.calls == 1


def test_no_candidate_is_refused(world) -> None:
    with pytest.raises(ValueError, match="no candidate action"):
        choose_actions(world, np.zeros((0, 6)), np.array([[0.8, -0.5]]))


def test_a_target_is_out_of_reach_only_when_no_candidate_is_predicted_near_it(world) -> None:
    class SureOfOne:
        """Sure of the first candidate alone, which ends far from the target."""

        def predict(self, actions):
            return world.predict(actions)

        def spread(self, actions):
            first = (actions == candidates[0]).all(axis=1)
            return np.where(first, 0.0, 5.0)[:, None] * np.ones(2)

    candidates = world.actions(300)
    near, far = world.predict(candidates)[5], np.array([3.0, -0.5])
    within, beyond = choose_actions(SureOfOne(), candidates, np.array([near, far]))
    assert within.miss_m > 0.03
    assert within.reachable
    assert not beyond.reachable
    assert "the nearest point within reach is" in beyond.out_of_reach()

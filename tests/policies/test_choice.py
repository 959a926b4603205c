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


def test_the_least_expected_miss_is_chosen(world) -> None:
    class Wild:
        """Sure of the first half of the candidates only."""

        def predict(self, actions):
            return world.predict(actions)

        def spread(self, actions):
            first = np.arange(len(actions)) < len(actions) // 2
            return np.where(first, 0.01, 0.5)[:, None] * np.ones(2)

    candidates, target = world.actions(300), np.array([[0.8, -0.5]])
    (choice,) = choose_actions(Wild(), candidates, target)
    away = np.linalg.norm(world.predict(candidates[:150]) - target, axis=1)
    assert choice.miss_m == pytest.approx(away.min())


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
            return np.where(np.arange(len(actions)) == 0, 0.0, 5.0)[:, None] * np.ones(2)

    candidates = world.actions(300)
    near, far = world.predict(candidates)[5], np.array([3.0, -0.5])
    within, beyond = choose_actions(SureOfOne(), candidates, np.array([near, far]))
    assert within.miss_m > 0.03
    assert within.reachable
    assert not beyond.reachable
    assert "the nearest point within reach is" in beyond.out_of_reach()

"""Casting again on the rig of a case, as a diagnosis that cannot tell two effects apart asks."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from typing import Any

from robotcast.casts.action import Action
from robotcast.casts.limits import PlanLimits
from robotcast.casts.plan import plan_action
from robotcast.hidden_effects.case import Case
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.rigs.virtual.rig import Eye, VirtualRig, measure_cast


def further_casts(
    measured: MeasurementSet,
    answer: Mapping[str, Any],
    nominal: VirtualRig,
    actions: Sequence[Action],
    eye: Eye,
    limits: PlanLimits,
    pool: Executor,
) -> MeasurementSet:
    """Return the set of a case with further casts added, one of each of `actions`.

    Parameters
    ----------
    answer : the case's answer; what it hides acts on the further casts too.
    nominal : the rig of the case's cable with nothing hidden.
    """
    case = Case(**answer["drawn"])
    rig = case.rig(nominal, {one["effect"]: one["parameters"] for one in answer["effects"]})
    track = partial(measure_cast, rig, replace(eye, noise_s=case.noise_s))
    first = 1 + max(trial.trial for trial in measured.trials)
    named = 1 + max(trial.action_id for trial in measured.trials)
    ids = {action: named + n for n, action in enumerate(dict.fromkeys(actions))}
    planned = [plan_action(action, r0_m=rig.r0_m, limits=limits) for action in actions]
    numbers = range(first, first + len(actions))
    added = pool.map(track, planned, numbers, [ids[action] for action in actions])
    return replace(measured, trials=(*measured.trials, *added))

"""From a tuned simulator and the casts it was tuned to, to D_sim or one shard of it."""

from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import DictConfig

from robotcast.build import action_space, build_effects, build_simulator, fingerprint
from robotcast.casts import plan
from robotcast.measurements.measurement_set import Trial, split_by_action
from robotcast.rigs.envelope import feasible_actions
from robotcast.simulators import d_sim
from robotcast.stage import bar, measured_set, output_folder, tell, warn
from robotcast.tuning.tuned import read_tuned, vector_of


def merge_d_sim(config: DictConfig) -> tuple[Path, dict[str, Any]]:
    """Write D_sim from all its shards; return its folder and how it came to be."""
    of, folder = config.generate.shards, output_folder(config.paths.simulated)
    shards = [Path(config.paths.shards) / d_sim.shard_name(number, of) for number in range(of)]
    return folder, d_sim.merge_shards(shards, folder)


def generate_d_sim(config: DictConfig) -> tuple[Path, dict[str, Any]]:
    """Simulate what the configured grid asks for, or a shard; return its folder and facts."""
    number, of = config.generate.shard, config.generate.shards
    shard = "" if number is None else d_sim.shard_name(number, of)
    tuned, sizes = Path(config.paths.tuned), config.scale.tune
    cable, active, values = read_tuned(tuned)
    simulator = build_simulator(config, cable, build_effects(active))
    vector = vector_of(simulator.parameters, values)
    grid, r0_m, limits, envelope = action_space(config, "generated")
    with bar("grid of actions") as progress:
        actions = feasible_actions(grid, r0_m, limits, envelope, progress)
    measured = measured_set(config.paths.measurements)
    tuning, _ = split_by_action(measured, sizes.tune_casts, sizes.test_casts, config.seed)
    following, reach_m = _following(tuning.trials, r0_m, limits), d_sim.mean_reach(tuning.trials)
    facts = {
        "cable": cable.name,
        "simulator": config.simulator.name,
        "optimizer": config.optimizer.name,
        "effects": active,
        "arm": {
            "lag_s": round(following.lag_s, 5),
            "told_rms_m": round(following.told_rms_m, 6),
            "followed_rms_m": round(following.followed_rms_m, 6),
            "period_s": following.period_s,
            "weights": following.weights.tolist(),
        },
        "reach_m": None if reach_m is None else [round(v, 6) for v in reach_m.tolist()],
    }
    folder, title = output_folder(config.paths.simulated), config.cable.name
    if number is not None:
        parts = {name: config[name] for name in ("simulator", "casts")}
        parts["grid"] = config.scale.generate
        facts["subject"] = fingerprint(config, parts, cable, facts, vector, actions)
        actions = np.array_split(actions, of)[number]
        folder, title = Path(config.paths.shards) / shard, f"{title} {shard}"
    with bar(f"generate {title}") as progress:
        endpoints_m = d_sim.generate_casts(
            simulator,
            vector,
            actions,
            partial(plan.plan_actions, r0_m=r0_m, limits=limits),
            settle_s=config.simulator.settle_s,
            follow=following.motion,
            reach_m=reach_m,
            progress=progress,
        )
    return folder, d_sim.write_d_sim(folder, actions, endpoints_m, facts)


def _following(trials: Sequence[Trial], r0_m: float, limits: plan.PlanLimits) -> plan.Following:
    """Return how the arm followed its plans in measured casts."""
    pairs = []
    for trial in trials:
        with suppress(ValueError):  # an action that is none of this rig's
            planned = plan.plan_action(trial.action, r0_m=r0_m, limits=limits)
            pairs.append((planned.tool, trial.tool))
    following = plan.fit_following(pairs, limits.period_s) if pairs else None
    if following is None or not following.believed:
        warn(
            "the logged motions are none that an arm makes of these plans: the casts were planned "
            "by something else, and D_sim moves the tool as planned here"
        )
        return plan.exact_following(limits.period_s)
    tell(
        f"the arm follows its plans {1e3 * following.lag_s:.0f} ms late; logged tools lie "
        f"{1e3 * following.followed_rms_m:.1f} mm from what it is taken to do with them "
        f"({1e3 * following.told_rms_m:.1f} mm from the plans)"
    )
    return following

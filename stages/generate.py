"""Generate D_sim for one cable with its tuned simulator, whole or one shard of it.

The tool moves as the arm followed its plans in the casts that the simulator was tuned to, and the
cable starts where their resets left it on average.
"""

import hashlib
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np
from effects import build_effects
from grids import build_limits, feasible_grid
from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf
from stage import bar, console, output_folder, stage

from robotcast.casts.following import Following, exact_following, fit_following
from robotcast.casts.plan import plan_action, plan_actions
from robotcast.measurements.measurement_set import Trial
from robotcast.measurements.reader import read_measurement_set
from robotcast.measurements.split import split_by_action
from robotcast.simulators.d_sim import Shard, generate_casts, mean_reach, write_d_sim
from robotcast.tuning.tuned import read_effects, read_values, vector_of


def generate(config: DictConfig) -> None:
    shard = _shard(config)
    cable, values = read_values(Path(config.paths.tuned))
    effects = build_effects(read_effects(Path(config.paths.tuned)))
    simulator = instantiate(config.simulator.model, cable=cable, effects=list(effects))
    vector = vector_of(simulator.parameters, values)
    with bar("grid of actions") as progress:
        actions = feasible_grid(config, progress, grid="generated")
    trials = _tuning_trials(config)
    following, reach_m = _following(config, trials), mean_reach(trials)
    facts = {
        "cable": cable.name,
        "simulator": config.simulator.name,
        "optimizer": config.optimizer.name,
        "effects": [effect.name for effect in effects],
        "arm": _facts_of(following),
        "reach_m": None if reach_m is None else [round(v, 6) for v in reach_m.tolist()],
    }
    if shard is None:
        folder, title = output_folder(config.paths.simulated), config.cable.name
    else:
        facts["subject"] = _subject(config, cable, facts, vector, actions)
        actions = shard.part(actions)
        folder, title = Path(config.paths.shards) / shard.name, f"{config.cable.name} {shard.name}"
    with bar(f"generate {title}") as progress:
        generated = generate_casts(
            simulator,
            vector,
            actions,
            partial(plan_actions, r0_m=config.casts.r0_m, limits=build_limits(config)),
            settle_s=config.simulator.settle_s,
            follow=following.motion,
            reach_m=reach_m,
            progress=progress,
        )
    write_d_sim(folder, generated, facts)
    lost = int(generated.diverged.sum())
    console.print(f"{folder}: {len(actions) - lost} casts, {lost} diverged and were left out")


def _tuning_trials(config: DictConfig) -> Sequence[Trial]:
    """Return the measured casts to tune to."""
    measured = read_measurement_set(Path(config.paths.measurements))
    sizes = config.scale.tune
    return split_by_action(measured, sizes.tune_casts, sizes.test_casts, config.seed)[0].trials


def _following(config: DictConfig, trials: Sequence[Trial]) -> Following:
    """Return how the arm followed its plans in measured casts."""
    limits = build_limits(config)
    pairs = []
    for trial in trials:
        with suppress(ValueError):  # an action that is none of this rig's
            planned = plan_action(trial.action, r0_m=config.casts.r0_m, limits=limits)
            pairs.append((planned.tool, trial.tool))
    following = fit_following(pairs, limits.period_s) if pairs else None
    if following is None or not following.believed:
        console.print(
            "the logged motions are none that an arm makes of these plans: the casts were planned "
            "by something else, and D_sim moves the tool as planned here",
            style="yellow",
        )
        return exact_following(limits.period_s)
    console.print(
        f"the arm follows its plans {1e3 * following.lag_s:.0f} ms late; logged tools lie "
        f"{1e3 * following.followed_rms_m:.1f} mm from what it is taken to do with them "
        f"({1e3 * following.told_rms_m:.1f} mm from the plans)"
    )
    return following


def _facts_of(following: Following) -> dict[str, object]:
    return {
        "lag_s": round(following.lag_s, 5),
        "told_rms_m": round(following.told_rms_m, 6),
        "followed_rms_m": round(following.followed_rms_m, 6),
        "period_s": following.period_s,
        "weights": following.weights.tolist(),
    }


def _shard(config: DictConfig) -> Shard | None:
    """Return the shard that is asked for, None for the whole."""
    number, of = config.generate.shard, config.generate.shards
    if number is None and of > 1:
        raise ValueError(f"generate.shards={of} needs generate.shard, from 0 to {of - 1}")
    return None if number is None else Shard(number, of)


def _subject(config: DictConfig, *known: object) -> str:
    """Return a fingerprint of everything that the casts of a D_sim depend on."""
    part = {"simulator": config.simulator, "casts": config.casts, "grid": config.scale.generate}
    text = OmegaConf.to_yaml(OmegaConf.create(part, parent=config), resolve=True)
    digest = hashlib.sha256(text.encode())
    for item in known:
        digest.update(item.tobytes() if isinstance(item, np.ndarray) else str(item).encode())
    return digest.hexdigest()


if __name__ == "__main__":
    stage(generate)()

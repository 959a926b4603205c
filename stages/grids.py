"""Making the configured plan limits, envelope and grids of actions."""

from typing import Any

import numpy as np
from omegaconf import DictConfig, OmegaConf

from robotcast.casts.grid import ActionGrid, GridCounts
from robotcast.casts.plan import PlanLimits
from robotcast.casts.reset import ResetSettings
from robotcast.progress import Progress, silent
from robotcast.rigs.envelope import Envelope, FilterReport, ToolBox, feasible_actions
from robotcast.rigs.kinematics import Gripper


def build_limits(config: DictConfig) -> PlanLimits:
    """Return the limits of the planned tool motion."""
    return PlanLimits(**config.casts.limits)


def build_reset(config: DictConfig) -> ResetSettings:
    """Return the shape and timing of the reset."""
    return ResetSettings(**config.casts.reset)


def build_envelope(config: DictConfig) -> Envelope:
    """Return what the arm may do during a cast."""
    plain: Any = plain_config(config.casts.envelope)
    plain.pop("reset_box")
    box, gripper = ToolBox(**plain.pop("box")), Gripper(**plain.pop("gripper"))
    return Envelope(**plain, box=box, gripper=gripper)


def feasible_grid(
    config: DictConfig, progress: Progress = silent, *, grid: str = "generated"
) -> np.ndarray:
    """Return the actions (m, 6) of the grid `collected` or `generated` that the arm can do."""
    return filtered_grid(config, progress, grid=grid)[0]


def filtered_grid(
    config: DictConfig, progress: Progress = silent, *, grid: str
) -> tuple[np.ndarray, FilterReport]:
    """Return a grid's feasible actions (m, 6) and what became of the others."""
    actions, limits = build_grid(config, grid), build_limits(config)
    return feasible_actions(actions, config.casts.r0_m, limits, build_envelope(config), progress)


def build_grid(config: DictConfig, grid: str) -> ActionGrid:
    """Return the grid `collected`, `generated` or `candidates`."""
    plain: Any = plain_config(config.casts.grids[grid])
    return ActionGrid(**{**plain, "counts": GridCounts(**plain["counts"])})


def plain_config(config: DictConfig) -> Any:
    """Return a part of the configuration as dicts and tuples."""
    return _tuples(OmegaConf.to_container(config, resolve=True))


def _tuples(node: Any) -> Any:
    if isinstance(node, dict):
        return {key: _tuples(value) for key, value in node.items()}
    return tuple(map(_tuples, node)) if isinstance(node, list) else node

"""Grids of actions."""

from dataclasses import dataclass, fields

import numpy as np

from robotcast.casts.curves import CastCurves, plan_curves
from robotcast.casts.limits import PlanLimits
from robotcast.casts.plan import check_actions


@dataclass(frozen=True)
class GridCounts:
    """How many values each coordinate of a grid takes."""

    theta1: int
    theta2: int
    r2: int
    alpha: int
    vmax: int

    def __post_init__(self) -> None:
        for field in fields(self):
            if getattr(self, field.name) < 1:
                raise ValueError(
                    f"grid: the count of {field.name} must be at least 1, "
                    f"got {getattr(self, field.name)}"
                )


@dataclass(frozen=True)
class ActionGrid:
    """Evenly spaced values of θ₁, θ₂, r₂, α and v_max, each [first, last].

    Only the half θ₁ > 0, θ₂ < 0, α ≥ 0 is sampled; mirror images are the other half (paper,
    "Parameterized Actions").
    """

    theta1_rad: tuple[float, float]
    theta2_rad: tuple[float, float]
    r2_m: tuple[float, float]
    alpha_rad: tuple[float, float]
    vmax_m_s: tuple[float, float]
    counts: GridCounts

    def __post_init__(self) -> None:
        for name, kept, rule in (
            ("theta1_rad", min(self.theta1_rad) > 0, "positive"),
            ("theta2_rad", max(self.theta2_rad) < 0, "negative"),
            ("alpha_rad", min(self.alpha_rad) >= 0, "zero or positive"),
        ):
            if not kept:
                raise ValueError(f"grid: {name} must be {rule}, got {list(getattr(self, name))}")

    def axes(self) -> list[tuple[float, float, int]]:
        """Return first, last and count of θ₁, θ₂, r₂, α and v_max."""
        ends = (self.theta1_rad, self.theta2_rad, self.r2_m, self.alpha_rad, self.vmax_m_s)
        return [
            (first, last, getattr(self.counts, field.name))
            for (first, last), field in zip(ends, fields(self.counts), strict=True)
        ]

    def candidates(self, r0_m: float, limits: PlanLimits) -> np.ndarray:
        """Return every action of the grid with its r₁, (n, 6), the last coordinate fastest."""
        return self.curves(r0_m, limits).actions

    def curves(self, r0_m: float, limits: PlanLimits) -> CastCurves:
        """Return the curves of every action of the grid."""
        axes = [np.linspace(*axis) for axis in self.axes()]
        axes.insert(1, np.array([np.nan]))
        actions = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 6)
        check_actions(actions, r0_m, limits, r1_given=False)
        return plan_curves(actions, r0_m, limits)

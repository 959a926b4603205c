"""A fitted field of missing force as the page draws it."""

from typing import Any

import numpy as np

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.unexplained import Unexplained, strengths
from robotcast.effects.fields import AlongMotionField, PlaceField

BOARD_X_M, BOARD_Y_M = (0.4, 1.3, 10), (-0.8, 0.8, 13)


def draw_field(inquiry: Inquiry, left: Unexplained) -> dict[str, Any] | None:
    """Return the field over the board or over one number; None for one that cannot be drawn."""
    field = inquiry.model.effects[left.field or ""]
    if isinstance(field, PlaceField):
        x, y = np.meshgrid(np.linspace(*BOARD_X_M), np.linspace(*BOARD_Y_M))
        points = np.stack([x.ravel(), y.ravel()], axis=1)
        axes, values = ["x [m]", "y [m]"], field.at(points, strengths(inquiry, left))
    elif isinstance(field, AlongMotionField):
        unit = {"speed": "m/s", "time": "s"}[field.depends_on or ""]
        axes, points = [f"{field.depends_on} [{unit}]"], field.at_values[:, None]
        values = -strengths(inquiry, left)[:, None]
    else:
        return None
    return {
        "acts_on": "the endpoint" if field.endpoint else "the whole cable",
        "endpoint": bool(field.endpoint),
        "axes": axes,
        "unit": "m/s²",
        "points": points.round(3).tolist(),
        "values": values.round(3).tolist(),
    }

"""One small diagnosis a state of the page, of the shape that diagnose writes."""

import json
from typing import Any

from robotcast.diagnosis.compare import compare
from tests.diagnosis.made_up_trials import SCALE, WORDS, made_up

BOARD_TILT = {
    "effect": "board_tilt",
    "text": "the board is not level",
    "p_value": 1.3e-7,
    "parameters": {
        "sx": {
            "value": 0.0011, "low": -0.0009, "high": 0.0031, "unit": "1", "null": 0.0,
        },
        "sy": {
            "value": -0.0249, "low": -0.0268, "high": -0.0231, "unit": "1", "null": 0.0,
        },
    },
    "predicted_typical_error_percent": 1.31,
    "realised_typical_error_percent": 1.04,
    "power": 0.99,
    "confusable_with": [],
    "status": "confirmed",
    "slices": [
        {"slice": "in the coast phase", "before_percent": 5.2, "after_percent": 1.3},
        {"slice": "on the left of the board", "before_percent": 4.4, "after_percent": 1.1},
        {"slice": "v_max above 2.5 m/s", "before_percent": 3.9, "after_percent": 1.2},
    ],
    "first_in_resamples": 0.97,
}  # fmt: skip

CAMERA_OFFSET = {
    **BOARD_TILT,
    "effect": "camera_offset",
    "text": "the camera's origin is shifted",
    "p_value": 0.004,
    "parameters": {
        "dx": {"value": 0.001, "low": -0.002, "high": 0.004, "unit": "m", "null": 0.0},
        "dy": {"value": -0.011, "low": -0.015, "high": -0.007, "unit": "m", "null": 0.0},
    },
    "predicted_typical_error_percent": 2.4,
    "realised_typical_error_percent": 2.53,
    "status": "refitted",
    "slices": [],
    "first_in_resamples": 0.03,
}

AIR_DRAG = {
    "effect": "air_drag",
    "text": "air slows the cable",
    "p_value": 0.00021,
    "parameters": {"C": {"value": 7.1, "low": 6.2, "high": 8.0, "unit": "1", "null": 0.0}},
    "predicted_typical_error_percent": 0.93,
    "realised_typical_error_percent": 0.81,
    "power": 0.94,
    "confusable_with": ["viscous_friction"],
    "status": "confirmed",
    "slices": [
        {"slice": "in the second arc", "before_percent": 2.1, "after_percent": 0.9},
    ],
    "first_in_resamples": 0.9,
}


def minor(effect: str, text: str, status: str, p_value: float | None, power: float | None):
    return {
        "effect": effect, "text": text, "p_value": p_value, "parameters": {},
        "predicted_typical_error_percent": None, "realised_typical_error_percent": None,
        "power": power, "confusable_with": [], "status": status, "slices": [],
        "first_in_resamples": 0.0,
    }  # fmt: skip


REST = [
    {
        **minor("tool_lag", "the tool follows its log late", "screened", 0.31, 0.98),
        "parameters": {
            "tau": {"value": 0.002, "low": -0.004, "high": 0.008, "unit": "s", "null": 0.0}
        },
        "predicted_typical_error_percent": 3.02,
    },
    minor("stribeck_friction", "friction is stronger in slow motion", "screened", 0.48, 0.91),
    minor("mass_gradient", "the cable is heavier at one end", "your casts cannot tell", 0.6, 0.21),
    minor("friction_patch", "a patch of the board rubs differently", "touches nothing", None, None),
    minor("resting_curvature", "the cable rests bent", "ignored by the model", None, None),
]

LADDER = [
    {
        "effects": [], "heldout_typical_error_percent": 3.12,
        "heldout_waypoint_error_percent": 3.12,
        "heldout_final_error_percent": 4.05,
        "standard_error_percent": 0.24,
    },
    {
        "effects": ["board_tilt"], "heldout_typical_error_percent": 1.04,
        "heldout_waypoint_error_percent": 1.04,
        "heldout_final_error_percent": 1.32,
        "standard_error_percent": 0.09,
    },
]  # fmt: skip

NEXT = [
    {
        "theta1": 0.8 - 0.1 * i, "r1": 0.61, "theta2": -0.9 + 0.1 * i, "r2": 0.62, "alpha": 0.4,
        "vmax": 2.0 + 0.1 * i, "separates": ["board_tilt", "camera_offset"],
        "difference_percent": 4.2 - 0.3 * i,
        "why": "slow in the end, so that the free end coasts where the board tilts most",
    }
    for i in range(5)
]  # fmt: skip

BASE = {
    "parameters": {
        "friction": {"value": 0.281, "low": 0.274, "high": 0.288, "unit": "1"},
        "bending_stiffness_n_m2": {
            "value": 6.5e-4, "low": 5.1e-4, "high": 8.2e-4, "unit": "N m²",
        },
        "grip_stiffness": {"value": 1.14, "low": None, "high": None, "unit": "1"},
    }
}  # fmt: skip


def effect() -> dict[str, Any]:
    return {
        "words": WORDS.as_dict(2),
        "conclusive": True,
        "pipeline": True,
        "verdict": ["board_tilt"],
        "code": "named",
        "sentence": "The board is not level: adding board_tilt lowers the error on held-out casts "
        "from 3.12 % to 1.04 % of cable length.",
        "confusion_set": [["board_tilt"]],
        "unexplained": None,
        "rig": "virtual",
        "measurements": "b",
        "casts": 52,
        "actions": 40,
        "error_unit": "% of cable length",
        "notes": [],
        "noise_floor_percent": 0.76,
        "ladder": LADDER,
        "ranking": [BOARD_TILT, CAMERA_OFFSET, *REST],
        "next_actions": [],
        "base": BASE,
        "comparison": None,
        "simulated_casts": 21040,
        "seconds": 93.4,
        "finished": True,
    }


def none() -> dict[str, Any]:
    return {
        **effect(),
        "verdict": ["none"], "code": "none",
        "sentence": "No effect of the library makes the model better on held-out casts: its error "
        "of 0.91 % is close to the noise floor of 0.76 %.",
        "confusion_set": [],
        "ladder": [{**LADDER[0], "heldout_typical_error_percent": 0.91,
        "heldout_waypoint_error_percent": 0.91,
                    "heldout_final_error_percent": 1.1, "standard_error_percent": 0.06}],
        "ranking": REST,
        "next_actions": [],
        "measurements": "a",
    }  # fmt: skip


def near() -> dict[str, Any]:
    """Nothing is confirmed, but two effects came near."""
    return {
        **none(),
        "sentence": "No effect of the library is confirmed: the error on held-out casts stays at "
        "1.42 % of cable length. It may be this: the board is not level or the camera's origin is "
        "shifted. With it the error is 1.04 % of cable length, but these casts do not confirm it.",
        "nearest": ["board_tilt", "camera_offset"],
        "confusion_set": [["board_tilt", "camera_offset"]],
        "ranking": [
            {**BOARD_TILT, "status": "refitted", "confusable_with": ["camera_offset"]},
            {**CAMERA_OFFSET, "confusable_with": ["board_tilt"]},
            *REST,
        ],
        "next_actions": NEXT,
    }


def several() -> dict[str, Any]:
    both = {**LADDER[1], "effects": ["board_tilt", "air_drag"],
            "heldout_typical_error_percent": 0.81,
            "heldout_waypoint_error_percent": 0.81, "heldout_final_error_percent": 0.95,
            "standard_error_percent": 0.05}  # fmt: skip
    return {
        **effect(),
        "verdict": ["board_tilt", "air_drag"],
        "code": "named",
        "sentence": "Two effects are missing: the board is not level (board_tilt) and air slows "
        "the cable (air_drag); together they lower the error from 3.12 % to 0.81 %.",
        "ladder": [*LADDER, both],
        "ranking": [BOARD_TILT, AIR_DRAG, *REST],
        "confusion_set": [["board_tilt"], ["air_drag"]],
    }


def confused() -> dict[str, Any]:
    return {
        **effect(),
        "verdict": ["board_tilt"],
        "code": "named",
        "sentence": "Either the board is not level (board_tilt) or the camera's origin is shifted "
        "(camera_offset): in these casts both leave the same trace.",
        "confusion_set": [["board_tilt", "camera_offset"]],
        "ranking": [
            {**BOARD_TILT, "confusable_with": ["camera_offset"], "first_in_resamples": 0.56},
            {**CAMERA_OFFSET, "confusable_with": ["board_tilt"], "first_in_resamples": 0.44},
            *REST,
        ],
        "next_actions": NEXT,
    }


def pull_field() -> dict[str, Any]:
    points = [
        [0.35 + 0.15 * i, -0.6 + 0.2 * j]
        for i in range(7)
        for j in range(7)
        if (i - 3) ** 2 + (j - 3) ** 2 < 14
    ]
    values = [[1.2 * (1.05 - x), 1.2 * (-0.25 - y)] for x, y in points]
    return {
        "acts_on": "the free end", "endpoint": True, "axes": ["x [m]", "y [m]"], "unit": "m/s²",
        "points": points, "values": values,
    }  # fmt: skip


def unknown() -> dict[str, Any]:
    return {
        **effect(),
        "verdict": ["unknown"],
        "code": "unknown",
        "sentence": "Something acts on the free end that no effect of the library explains; it "
        "depends on where the free end is.",
        "confusion_set": [],
        "unexplained": {
            "depends_on": "place",
            "explains": True,
            "text": "A force on the free end that depends on its place explains most of the error "
            "that is left. It is strongest at the edges of the board.",
            "field": pull_field(),
            "heldout_typical_error_percent": 1.3,
            "heldout_waypoint_error_percent": 1.3,
        },
        "ladder": LADDER[:1],
        "ranking": [{**CAMERA_OFFSET, "status": "refitted"}, *REST],
        "next_actions": NEXT[:2],
        "measurements": "f",
    }


def unknown_speed() -> dict[str, Any]:
    speeds = [0.1 * i for i in range(21)]
    field = {
        "acts_on": "every piece of the cable", "axes": ["speed [m/s]"], "unit": "m/s²",
        "points": [[v] for v in speeds], "values": [[-0.4 * v - 0.3 * v**2] for v in speeds],
    }  # fmt: skip
    plain = unknown()
    return {**plain, "unexplained": {**plain["unexplained"], "depends_on": "speed",
                                     "text": "A braking force that grows with speed.",
                                     "field": field}}  # fmt: skip


def running() -> dict[str, Any]:
    return {
        **effect(),
        "verdict": [], "sentence": "", "confusion_set": [], "finished": False,
        "doing": "refitting board_tilt", "seconds": None, "simulated_casts": 5200,
        "ladder": LADDER[:1],
        "ranking": [
            {**BOARD_TILT, "status": "screened", "realised_typical_error_percent": None,
             "slices": [], "first_in_resamples": None},
            *REST,
        ],
    }  # fmt: skip


def just_started() -> dict[str, Any]:
    return {
        "words": WORDS.as_dict(2), "finished": False, "doing": "fitting the base model",
        "measurements": "b",
    }  # fmt: skip


def too_few() -> dict[str, Any]:
    return {
        **effect(),
        "verdict": ["none"],
        "sentence": "Three casts are too few to judge any effect.",
        "conclusive": False, "code": "cannot tell",
        "confusion_set": [], "casts": 3, "actions": 3, "noise_floor_percent": None,
        "notes": [
            "The set has 3 casts; at least 8 of different actions are needed to hold some back.",
            "No action was repeated, so the noise floor is unknown.",
            "Cast 2 lies 50 cm away from every other cast with a similar action; it was left out.",
            "The tool log is missing; the planned motion stands in for it.",
        ],
        "ladder": [], "ranking": [], "next_actions": NEXT[:3],
    }  # fmt: skip


def with_gaps() -> dict[str, Any]:
    """A finished diagnosis in which everything that may be missing is."""
    gaps = {key: None for key in ("p_value", "power", "first_in_resamples")}
    return {
        **effect(),
        "noise_floor_percent": None, "casts": None, "seconds": None, "simulated_casts": None,
        "ranking": [{**BOARD_TILT, **gaps, "slices": None, "parameters": None,
                     "realised_typical_error_percent": None}],
        "base": None,
    }  # fmt: skip


def compared() -> dict[str, Any]:
    """An effect found, with every cast laid beside the base model."""
    made = made_up(groups=12)
    found = compare(
        made.records, made.predicted, scale=SCALE, error_unit="% of cable length", wording=WORDS
    )
    return {**effect(), "comparison": json.loads(json.dumps(found.as_dict()))}


STATES = {
    "compared": compared,
    "none": none,
    "near": near,
    "effect": effect,
    "several": several,
    "unknown": unknown,
    "unknown_speed": unknown_speed,
    "confused": confused,
    "running": running,
    "just_started": just_started,
    "too_few": too_few,
    "with_gaps": with_gaps,
}

"""The paper's own results (tables "tuning", "error" and "results"): a UR5 and real cables.

They stand beside ours as a reference for form and order of magnitude. A virtual rig is another
world than the paper's laboratory, so neither being below nor above them proves anything.
"""

PAPER_RIG = "paper’s robot"

QUARTILES = ("Median", "Q1", "Q3", "Min", "Max")

# simulator → cable → (average waypoint error, median final error), % of cable length
TUNING = {
    "bullet": {"cable1": (29, 28), "cable2": (28, 28), "cable3": (23, 17)},
    "hybrid": {"cable1": (14, 23), "cable2": (11, 14), "cable3": (11, 13)},
    "segmented": {"cable1": (9, 13), "cable2": (8, 9), "cable3": (11, 13)},
}

# (policy, dataset) → QUARTILES, % of cable length, Cable 1
POLICIES = {
    ("cast_and_pull", "none"): (61, 38, 86, 6, 124),
    ("gp", "real"): (27, 9, 51, 4, 97),
    ("nn", "real"): (15, 11, 21, 8, 36),
    ("nn", "simulated"): (14, 10, 17, 6, 115),
    ("nn", "mixed"): (8, 5, 12, 2, 105),
}

# cable → QUARTILES of π_R2S2R, % of cable length
CABLES = {
    "cable1": (8, 5, 12, 2, 105),
    "cable2": (12, 8, 16, 4, 28),
    "cable3": (14, 9, 23, 6, 38),
}

# simulator → optimizer → (least, largest) error of the tuned parameters in % ("Comparing
# Real2Sim Tuning Methods"), Bayesian optimization over its acquisitions with 5 casts
SIM2SIM = {
    "hybrid": {"bo": (3.39, 17.98), "de": (None, 1.0)},
    "segmented": {"bo": (1.09, 9.25), "de": (None, 1.0)},
}
SIM2SIM_CASTS = 5

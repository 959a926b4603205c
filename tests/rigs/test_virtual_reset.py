from pathlib import Path

import numpy as np
import pytest
import yaml

from robotcast.casts.reset import ResetSettings
from robotcast.rigs.virtual.studies import (
    CHAOTIC,
    NUDGE_M,
    amplification,
    resting_headings,
    simulate_reset,
)

pytestmark = [pytest.mark.slow, pytest.mark.rig]

CASTS = Path(__file__).parents[2] / "conf/casts/arcs.yaml"


def test_the_full_reset_lays_the_cable_straight_again(rig, short_cast):
    settings = ResetSettings(**yaml.safe_load(CASTS.read_text())["reset"])
    motion = simulate_reset(rig, short_cast, 0, settings)
    assert motion.nodes_m[..., 2].max() > 0.5
    held, end = motion.nodes_m[-1, 0], motion.nodes_m[-1, -1]
    np.testing.assert_allclose(held[:2], [rig.r0_m, 0], atol=1e-4)
    assert np.linalg.norm(end - held) == pytest.approx(rig.cable.length_m, rel=0.002)
    assert np.abs(resting_headings(motion)).max() < 0.03


def test_a_gentle_cast_is_not_chaotic(quiet_rig, short_cast):
    assert NUDGE_M == 0.001
    assert 0.05 < amplification(quiet_rig, short_cast) < CHAOTIC / 2

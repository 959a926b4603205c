"""What every effect of conf/effect/ must do inside the segmented simulator."""

import numpy as np
import pytest

from robotcast.simulators.segmented import PARAMETERS as OWN
from robotcast.simulators.segmented import SegmentedSettings, SegmentedSimulator
from robotcast.simulators.simulator import SimulatedCast
from tests.simulators.conftest import CABLE, CONFIGURATION, PARAMETERS, load_effect

NAMES = sorted(path.stem for path in (CONFIGURATION / "effect").glob("*.yaml"))
TUNED = SegmentedSimulator.tunes


def simulator(*names: str) -> SegmentedSimulator:
    return SegmentedSimulator(
        CABLE, PARAMETERS, SegmentedSettings(), [load_effect(n) for n in names]
    )


def test_the_library_is_complete() -> None:
    assert len(NAMES) >= 17


@pytest.mark.parametrize("name", [n for n in NAMES if n not in TUNED])
def test_null_changes_no_bit_and_a_probe_moves_the_end(
    name: str, casts: list[SimulatedCast]
) -> None:
    """Also beside other values in one batch: the first vector is null, the second is not."""
    bare, with_effect = simulator(), simulator(name)
    nominal = np.array([[p.nominal for p in bare.parameters]])
    own = with_effect.parameters[len(OWN) :]
    null = [p.nominal for p in own]
    probe = [p.probes[-1] if p.null is not None else p.nominal for p in own]
    vectors = np.array([[*nominal[0], *null], [*nominal[0], *probe]])
    expected = bare.simulate(casts, nominal).waypoints_m[0]
    got = with_effect.simulate(casts, vectors).waypoints_m
    np.testing.assert_array_equal(got[0], expected)
    assert np.nanmax(np.abs(got[1] - expected)) > 1e-4


def test_all_effects_at_null_change_no_bit(casts: list[SimulatedCast]) -> None:
    bare, loaded = simulator(), simulator(*[n for n in NAMES if n not in TUNED])
    vectors = [np.array([[p.nominal for p in s.parameters]]) for s in (bare, loaded)]
    np.testing.assert_array_equal(
        loaded.simulate(casts, vectors[1]).waypoints_m,
        bare.simulate(casts, vectors[0]).waypoints_m,
    )


@pytest.mark.parametrize("name", TUNED)
def test_an_effect_that_the_simulator_tunes_is_not_offered(name: str) -> None:
    with pytest.raises(ValueError, match="parameter of its own"):
        simulator(name)

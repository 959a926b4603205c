from dataclasses import replace

import numpy as np
import pytest

from robotcast.rigs.virtual.cable import RECORD_S, CableRun, build_cable, compile_cable

HELD = np.array([0.6, 0.0, 0.0, 0.0, 0.0])


def start(cable, truth, *, bend_rad=0.0, held=HELD) -> CableRun:
    headings = np.linspace(0.0, bend_rad, truth.segments)
    return CableRun(compile_cable(build_cable(cable, truth)), headings, held)


def kept(seconds, truth, held=HELD):
    return np.tile(held, (round(seconds / truth.step_s) + 1, 1))


def swept(truth, seconds=0.6, reach_m=0.4):
    """The held end moves left and stops, then a second of rest."""
    steps = np.arange(round((seconds + 1.0) / truth.step_s) + 1) * truth.step_s
    path = np.tile(HELD, (len(steps), 1))
    share = np.clip(steps / seconds, 0, 1)
    path[:, 1] = reach_m * share**3 * (10 - 15 * share + 6 * share**2)
    return path


def test_the_chain_has_the_cables_length_and_mass(cable, truth):
    run = start(cable, truth)
    nodes = run.drive(kept(0.002, truth), moving_s=1.0).nodes_m[0]
    assert np.linalg.norm(np.diff(nodes, axis=0), axis=1).sum() == pytest.approx(cable.length_m)
    chain = run.model.body_subtreemass[run.model.body("segment_0").id]
    assert chain == pytest.approx(cable.mass_kg + cable.endpoint_mass_kg)
    assert truth.segments >= 30


def test_a_bent_cable_on_the_board_stays_where_friction_holds_it(cable, truth):
    run = start(cable, truth, bend_rad=0.1)
    run.settle()
    motion = run.drive(kept(1.0, truth), moving_s=1.0)
    assert np.abs(motion.end_m[-1] - motion.end_m[0]).max() < 0.001
    assert motion.end_m[-1, 2] == pytest.approx(cable.radius_m, abs=2e-4)


def test_the_held_end_follows_its_path_to_a_hundredth_of_a_millimetre(cable, truth):
    run, path = start(cable, truth), swept(truth)
    motion = run.drive(path, moving_s=10.0)
    told = path[:: round(RECORD_S / truth.step_s), :2][: len(motion.t_s)]
    held = motion.nodes_m[:, 0]
    assert np.abs(held[:, :2] - told).max() < 1e-5
    assert np.abs(held[:, 2] - cable.radius_m).max() < 1e-5


def test_the_cable_does_not_stretch_and_stays_on_the_board(cable, truth):
    nodes = start(cable, truth).drive(swept(truth), moving_s=10.0).nodes_m
    lengths = np.linalg.norm(np.diff(nodes, axis=1), axis=2)
    np.testing.assert_allclose(lengths, cable.length_m / truth.segments, rtol=1e-9)
    assert nodes[..., 2].min() > 0.8 * cable.radius_m
    assert nodes[..., 2].max() < 2 * truth.endpoint_radius_m


def test_a_rougher_board_stops_the_end_earlier(cable, truth):
    def coasted(factor):
        run = start(cable, replace(truth, friction=factor * truth.friction))
        return run.drive(swept(truth, 0.35), moving_s=10.0).end_m[-1, 1]

    assert coasted(1.5) < coasted(1.0) - 0.01 < coasted(0.6) - 0.02


def test_a_clamped_cable_in_the_air_sags_like_a_beam(cable, truth):
    stiffness = 1.0
    stiff = replace(truth, bending_stiffness_n_m2=stiffness, hysteresis_n_m=0.0)
    high = HELD + np.array([0, 0, 0.3, 0, 0])
    end = start(cable, stiff, held=high).drive(kept(1.5, stiff, high), moving_s=10.0).end_m[-1]
    g, length = 9.81, cable.length_m
    from_end = cable.endpoint_mass_kg * g * length**3 / (3 * stiffness)
    from_cable = cable.mass_kg * g * length**3 / (8 * stiffness)
    assert 0.3 + cable.radius_m - end[2] == pytest.approx(from_end + from_cable, rel=0.03)


def test_halving_the_time_step_moves_the_end_by_millimetres(cable, truth):
    ends = [
        start(cable, fine).drive(swept(fine), moving_s=10.0).end_m[-1]
        for fine in (truth, replace(truth, step_s=truth.step_s / 2))
    ]
    assert np.linalg.norm(ends[0] - ends[1]) < 0.004


def test_a_run_that_diverges_is_refused(cable, truth):
    run = start(cable, truth)
    path = kept(0.2, truth)
    path[50:, 1] = 50.0
    with pytest.raises(ValueError, match="diverged"):
        run.drive(path, moving_s=10.0)

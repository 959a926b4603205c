"""The missing force: where its arrows point, and the effect drafted after it."""

import numpy as np
import pytest
import yaml

from robotcast.effects.effect import CableMotion, Effect
from robotcast.measurements.measurement_set import Cable
from robotcast.reporting.missing_force import Field, drafts, field_figure, focus, strongest
from robotcast.reporting.style import inline
from tests.reporting.diagnosis_states import pull_field, unknown, unknown_speed

BOARD = np.array([[x, y] for x in np.linspace(0.3, 1.3, 6) for y in np.linspace(-0.8, 0.8, 6)])


def board_field(values: np.ndarray) -> Field:
    points, rows = BOARD.tolist(), values.tolist()
    return {"axes": ["x [m]", "y [m]"], "unit": "m/s²", "points": points, "values": rows}


@pytest.mark.parametrize("sign", [1, -1])
def test_arrows_towards_or_away_from_a_place_find_it(sign: int) -> None:
    place = np.array([1.05, -0.25])
    noise = np.random.default_rng(0).normal(0, 0.02, BOARD.shape)
    aimed = focus(board_field(sign * (place - BOARD) + noise))
    assert aimed is not None
    np.testing.assert_allclose(aimed[0], place, atol=0.05)
    assert aimed[1] == (sign > 0)


def test_parallel_arrows_and_whirls_point_at_no_place() -> None:
    assert focus(board_field(np.tile([0.3, 0.1], (len(BOARD), 1)))) is None
    whirl = (BOARD - BOARD.mean(axis=0))[:, ::-1] * [1, -1]
    assert focus(board_field(whirl)) is None


def test_the_strongest_place_is_said_with_units() -> None:
    values = np.zeros_like(BOARD)
    values[7] = [0.0, 0.45]
    assert strongest(board_field(values)).replace("\u202f", " ") == (
        "strongest, 0.45 m/s², at x = 0.500 m, y = −0.480 m"
    )


def test_a_number_over_the_board_is_drawn_too() -> None:
    figure = field_figure(board_field(BOARD[:, :1] - 0.8))
    assert inline(figure, "force").count("<title>") == len(BOARD)


def two_cables() -> CableMotion:
    """Two cables of three pieces in some motion."""
    rng = np.random.default_rng(1)
    points, hinges = rng.uniform(-1, 1, (9, 2, 4)), rng.uniform(-0.3, 0.3, (2, 2, 3))
    return CableMotion(
        Cable("cable1", 0.6, 0.02, 0.005, 0.02), 0.4, 0.004, np.full(3, 0.2), *points[:4],
        *points[4:8], mass_kg=np.full((2, 4), 0.01), friction_n=np.full((2, 4), 0.03),
        bend_rad=hinges[0], bend_rate_rad_s=hinges[1], bends_m=np.full(3, 0.2), memory={},
    )  # fmt: skip


def drafted(depends_on: str, field: Field | None) -> Effect:
    """Return the effect that is drafted, as its two texts make it."""
    code, settings = drafts({"depends_on": depends_on, "field": field}).values()
    room: dict = {}
    exec(code, room)
    plain = yaml.safe_load(settings)["effects"]["my_effect"]
    return room["MyEffect"]("my_effect", plain["text"], plain["parameters"])


@pytest.mark.parametrize("depends_on", ["place", "speed", "heading", "time", "bending", "endpoint"])
def test_a_drafted_effect_works_and_does_nothing_at_its_null(depends_on: str) -> None:
    effect, cable = drafted(depends_on, None), two_cables()
    hook = effect.bending_moment if depends_on == "bending" else effect.force
    at_null = {p.name: np.full((2, 1), p.nominal) for p in effect.parameters}
    assert not np.any(hook(cable, **at_null))
    probed = {p.name: np.full((2, 1), p.probes[0]) for p in effect.parameters}
    acting = np.array(hook(cable, **probed))
    assert np.isfinite(acting).all() and np.any(acting)
    if depends_on == "endpoint":
        assert not np.any(acting[:, :, :-1])


def test_a_draft_starts_where_the_arrows_point_and_acts_on_what_they_act_on() -> None:
    code, settings = drafts(unknown()["unexplained"]).values()
    assert "on_endpoint" in code
    drafted = yaml.safe_load(settings)["effects"]["my_effect"]
    assert drafted["parameters"]["x0"]["nominal"] == pytest.approx(1.05)
    everywhere = {**unknown()["unexplained"], "field": {**pull_field(), "endpoint": False}}
    assert "on_endpoint" not in "".join(drafts(everywhere).values())


def test_a_resistance_over_the_board_drafts_a_brake_where_it_is_strongest() -> None:
    points, values = [[0.5, 0.0], [0.9, -0.2], [1.1, 0.3]], [[0.1], [1.4], [-0.2]]
    field = {"axes": ["x [m]", "y [m]"], "unit": "m/s²", "points": points, "values": values}
    effect, cable = drafted("place", field), two_cables()
    (x0,) = (p.nominal for p in effect.parameters if p.name.endswith("x0"))
    assert x0 == pytest.approx(0.9)
    probed = {p.name: np.full((2, 1), abs(p.probes[0])) for p in effect.parameters}
    x, y = effect.force(cable, **probed)
    assert (x * cable.vx + y * cable.vy <= 0).all() and np.any(x)


def test_a_force_by_speed_is_a_curve() -> None:
    field = unknown_speed()["unexplained"]["field"]
    figure = inline(field_figure(field), "force")
    assert "speed [m/s]" in figure and "missing force [m/s²]" in figure
    assert focus(field) is None

"""A small correct set on disk, and the recorded sets that lie beside the repository."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from robotcast.casts.action import Action
from robotcast.casts.plan import PlanLimits, plan_action
from robotcast.casts.table import TABLE_COLUMNS

RIG = """\
cable: {name: cable1, length_m: 0.63, mass_kg: 0.008, radius_m: 0.0045, endpoint_mass_kg: 0.02}
robot: {r0_m: 0.6}
camera: {period_s: 0.1, noise_m: 0.002}
"""
SWINGS = [
    (0.7, 0.62, -0.6, 0.65, 0.5, 1.25),
    (0.5, 0.62, -0.8, 0.7, 0.4, 1.5),
    (0.7, 0.62, -0.6, 0.65, 0.5, 1.25),
]


Tables = dict[str, pl.DataFrame]


def casts() -> Tables:
    """Three casts of two actions: the end trails the tool on a taut cable until both rest."""
    noise = np.random.default_rng(0)
    parts: dict[str, list[pl.DataFrame]] = {name: [] for name in TABLE_COLUMNS}
    for trial, swing in enumerate(SWINGS):
        action = Action(*swing)
        tool = plan_action(action, r0_m=0.6, limits=PlanLimits()).tool
        t_s = np.round(np.arange(0, tool.t_s[-1] + 1.0, 0.1), 6)
        behind, held = (tool.at(t_s - late_s)[:, :2] for late_s in (0.15, 0.0))
        end = held + 0.62 * behind / np.linalg.norm(behind, axis=1, keepdims=True)
        end += 0.002 * noise.standard_normal(end.shape)
        rows = {
            "actions": [[trial, trial % 2, *swing]],
            "tool": np.column_stack([np.full(len(tool.t_s), trial), tool.t_s, tool.pose]),
            "waypoints": np.column_stack([np.full(len(t_s), trial), t_s, end]),
        }
        for name, some in rows.items():
            frame = pl.DataFrame(np.round(some, 6), TABLE_COLUMNS[name], orient="row")
            whole = [name for name in ("trial", "action") if name in frame.columns]
            parts[name].append(frame.cast(dict.fromkeys(whole, pl.Int64)))
    return {name: pl.concat(frames) for name, frames in parts.items()}


def write_set(folder: Path, tables: Tables, rig: str = RIG) -> Path:
    folder.mkdir()
    (folder / "rig.yaml").write_text(rig, encoding="utf-8")
    for name, table in tables.items():
        table.write_csv(folder / f"{name}.csv")
    return folder


@pytest.fixture
def set_folder(tmp_path: Path) -> Path:
    return write_set(tmp_path / "set", casts())


@pytest.fixture(scope="session")
def recorded_sets() -> Path:
    folder = Path(__file__).resolve().parents[3] / "shared" / "data" / "casting"
    if not folder.is_dir():
        pytest.skip("the recorded sets do not lie beside the repository")
    return folder

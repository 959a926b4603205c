"""A small correct set on disk, and the recorded sets that lie beside the repository."""

from pathlib import Path

import pytest

from robotcast.measurements.reader import write_measurement_set
from tests.good_casts import good_set

RIG = """\
cable: {name: cable1, length_m: 0.63, mass_kg: 0.008, radius_m: 0.0045, endpoint_mass_kg: 0.02}
robot: {r0_m: 0.6}
camera: {period_s: 0.1, noise_m: 0.002}
"""


@pytest.fixture
def set_folder(tmp_path: Path) -> Path:
    folder = tmp_path / "set"
    write_measurement_set(good_set(), folder)
    (folder / "rig.yaml").write_text(RIG, encoding="utf-8")
    return folder


@pytest.fixture(scope="session")
def recorded_sets() -> Path:
    folder = Path(__file__).resolve().parents[3] / "shared" / "data" / "casting"
    if not folder.is_dir():
        pytest.skip("the recorded sets do not lie beside the repository")
    return folder

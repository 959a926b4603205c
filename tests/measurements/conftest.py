"""A small correct set on disk, and the recorded sets that lie beside the repository."""

from pathlib import Path

import pytest

RIG = """\
cable: {name: cable1, length_m: 0.63, mass_kg: 0.008, radius_m: 0.0045, endpoint_mass_kg: 0.02}
robot: {r0_m: 0.6}
camera: {period_s: 0.1, noise_m: 0.002}
"""
ACTIONS = """\
trial,action,theta1,r1,theta2,r2,alpha,vmax
0,0,0.7,0.6,-0.6,0.65,0.5,1.25
1,1,0.5,0.6,-0.8,0.7,0.4,1.5
2,0,0.7,0.6,-0.6,0.65,0.5,1.25
"""
TOOL = """\
trial,t,x,y,yaw
0,0,0.6,0,0
0,0.008,0.59,0.01,0.1
1,0,0.6,0,0
1,0.008,0.59,0.02,0.2
2,0,0.6,0,0
2,0.008,0.59,0.01,0.1
"""
WAYPOINTS = """\
trial,t,x,y
0,0,1.23,0
0,0.1,1.22,0.01
0,0.3,1.2,0.03
1,0,1.23,0
2,0,1.231,0
2,0.1,1.22,0.02
"""
FILES = {
    "rig.yaml": RIG,
    "actions.csv": ACTIONS,
    "tool.csv": TOOL,
    "waypoints.csv": WAYPOINTS,
}


@pytest.fixture
def set_folder(tmp_path: Path) -> Path:
    folder = tmp_path / "set"
    folder.mkdir()
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


@pytest.fixture(scope="session")
def recorded_sets() -> Path:
    folder = Path(__file__).resolve().parents[3] / "shared" / "data" / "casting"
    if not folder.is_dir():
        pytest.skip("the recorded sets do not lie beside the repository")
    return folder

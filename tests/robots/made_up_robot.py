"""A slider and a two-link arm whose logs MuJoCo makes itself, a tenth of the step."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import polars as pl
import yaml

from robotcast.diagnosis.diagnose import diagnose
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.robots.robot_case import RobotCase

SLIDER = """
<mujoco><option timestep="0.005" integrator="implicitfast"/><worldbody>
<body name="table"><joint name="axis" type="slide" axis="1 0 0" damping="2" range="-3 3"/>
<inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.1"/></body></worldbody>
<actuator><motor name="motor" joint="axis" ctrllimited="true" ctrlrange="-10 10"/></actuator>
<sensor><jointvel name="tacho" joint="axis"/></sensor></mujoco>"""

ARM = """
<mujoco><option timestep="0.005" integrator="implicitfast"/><worldbody>
<body name="upper"><joint name="shoulder" axis="0 1 0" damping="0.05" armature="0.01"/>
<inertial pos="0 0 -0.15" mass="0.8" diaginertia="0.006 0.006 0.0005"/>
<body name="fore" pos="0 0 -0.3"><joint name="elbow" axis="0 1 0" damping="0.03"/>
<inertial pos="0 0 -0.12" mass="0.5" diaginertia="0.003 0.003 0.0003"/></body></body></worldbody>
<actuator><position name="s" joint="shoulder" kp="25" kv="1.2"/>
<motor name="e" joint="elbow"/></actuator></mujoco>"""

FEW = ("dry_friction_axis", "viscous_friction_axis", "drive_gain_axis", "mass_table")
PERIOD_S, QUANTUM = 0.01, 1e-4
AMPLITUDE = np.array([1.0, 0.3, 0.6, 0.5, 0.4])


def write_folder(
    folder: Path,
    xml: str = SLIDER,
    *,
    logs: int = 8,
    length_s: float = 1.5,
    change: Callable[[mujoco.MjModel], None] = lambda model: None,
    noise: float = QUANTUM,
    spring: float = 0.0,
    finer: int = 10,
    **more: object,
) -> Path:
    """Write model, logs and robot.yaml of a robot in which `change` is hidden, or a spring."""
    model = mujoco.MjModel.from_xml_string(xml)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.xml").write_text(xml, encoding="utf-8")
    names = [model.joint(j).name for j in range(model.njnt)]
    drives = [model.actuator(a).name for a in range(model.nu)]
    said = {
        "model": "robot.xml",
        "logs": "log*.csv",
        "time": {"column": "t", "unit": "s"},
        "drive": {f"actuator[{a}]": {"column": f"u_{a}"} for a in drives},
        "measured": {f"joint[{j}].position": {"column": f"q_{j}"} for j in names},
        **more,
    }
    (folder / "robot.yaml").write_text(yaml.safe_dump(said, sort_keys=False), encoding="utf-8")
    if spring:
        spec = mujoco.MjSpec.from_string(xml)
        joint = spec.joints[0]
        joint.parent.simple = 0  # MuJoCo takes two slides along one axis for orthogonal ones
        twist = joint.parent.add_joint(name="twist", type=joint.type)
        twist.axis, twist.stiffness[0], twist.damping[0] = joint.axis, spring, 0.005 * spring
        model = spec.compile()
    change(model)
    model.opt.timestep /= finer
    per_sample = round(PERIOD_S / model.opt.timestep)
    for number in range(logs):
        rng = np.random.default_rng(number)
        data, rows = mujoco.MjData(model), []
        hertz, phase = rng.uniform(0.4, 2.0, (2, model.nu))
        for k in range(round(length_s / PERIOD_S)):
            t_s = k * PERIOD_S
            command = AMPLITUDE[: model.nu] * np.sin(2 * np.pi * (hertz * t_s + phase))
            command *= 4.0 if model.nu == 1 else 1.0
            data.ctrl[:] = command
            own = [data.joint(j).qpos[0] for j in names]
            seen = own + noise * rng.normal(size=len(names))
            rows.append([t_s, *command, *(np.round(seen / QUANTUM) * QUANTUM)])
            mujoco.mj_step(model, data, per_sample)
        columns = ["t", *(f"u_{a}" for a in drives), *(f"q_{j}" for j in names)]
        table = pl.DataFrame(dict(zip(columns, np.array(rows).T, strict=True)))
        table.write_csv(folder / f"log{number}.csv")
    return folder


def rewrite(folder: Path, *columns: pl.Expr, **named: pl.Series) -> Path:
    """Replace columns of all logs."""
    for path in folder.glob("*.csv"):
        pl.read_csv(path).with_columns(*columns, **named).write_csv(path)
    return folder


def diagnosed(case: RobotCase, *more: str) -> dict[str, Any]:
    """Return what a diagnosis with a few candidates says."""
    laws = [n for n, e in case.model.effects.items() if e.depends_on is None]
    others = [n for n in laws if n not in (*FEW, *more)]
    effort = Effort(some=12, tried=3, finalists=1)
    return diagnose(case.question(others, (), Rule(), effort), lambda known: None)

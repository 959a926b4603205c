"""Hidden effects of small robots: does the diagnosis name what was hidden, and nothing else?

python benchmarks/robots.py [CASE ...] [--output DIR]

The truth is made otherwise than any model that is asked: MuJoCo steps it ten times finer with
Runge–Kutta, hidden forces are written here a second time, and sensors are quantised and noisy.
"""

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import polars as pl
import yaml
from mujoco.batch import Batch

PERIOD_S, LOG_S, LOGS, FINER = 0.005, 4.0, 12, 10

CART_POLE = """
<mujoco model="cart pole"><compiler autolimits="true"/>
<option timestep="0.002" integrator="implicitfast"/><worldbody>
<body name="cart"><joint name="slider" type="slide" axis="1 0 0" damping="0.5"/>
<inertial pos="0 0 0" mass="1.0" diaginertia="0.01 0.01 0.01"/>
<body name="pole"><joint name="hinge" axis="0 1 0" damping="0.002"/>
<inertial pos="0 0 -0.25" mass="0.3" diaginertia="0.006 0.006 0.0002"/></body></body></worldbody>
<actuator><motor name="push" joint="slider"/></actuator></mujoco>"""

TWO_LINK = """
<mujoco model="two-link arm"><compiler autolimits="true"/>
<option timestep="0.002" integrator="implicitfast"/><worldbody>
<body name="upper"><joint name="shoulder" axis="0 1 0" damping="0.05" armature="0.01"/>
<inertial pos="0 0 -0.15" mass="0.8" diaginertia="0.006 0.006 0.0005"/>
<body name="fore" pos="0 0 -0.3"><joint name="elbow" axis="0 1 0" damping="0.03" armature="0.005"/>
<inertial pos="0 0 -0.12" mass="0.5" diaginertia="0.003 0.003 0.0003"/></body></body></worldbody>
<actuator><position name="s" joint="shoulder" kp="25" kv="1.2"/>
<position name="e" joint="elbow" kp="12" kv="0.5"/></actuator></mujoco>"""

SLIDER = """
<mujoco model="slider"><compiler autolimits="true"/>
<option timestep="0.002" integrator="implicitfast"/><worldbody>
<body name="table"><joint name="axis" type="slide" axis="1 0 0" damping="8"/>
<inertial pos="0 0 0" mass="4.0" diaginertia="0.1 0.1 0.1"/></body></worldbody>
<actuator><motor name="motor" joint="axis" gear="10"/></actuator></mujoco>"""


@dataclass(frozen=True)
class Mechanism:
    """A robot: its model, how strongly it is driven, and its encoders' steps by joint."""

    xml: str
    drive: tuple[float, ...]
    step: tuple[float, ...]


MECHANISMS = {
    "cart_pole": Mechanism(CART_POLE, (4.0,), (1e-4, 5e-4)),
    "two_link": Mechanism(TWO_LINK, (0.8, 1.0), (3e-4, 3e-4)),
    "slider": Mechanism(SLIDER, (4.0,), (2e-5,)),
}


Force = Callable[[np.ndarray, np.ndarray], np.ndarray]  # positions, speeds → joint forces


@dataclass(frozen=True)
class Hidden:
    """What is hidden in one case, and what a right verdict says."""

    mechanism: str
    answer: tuple[str, ...]
    change: Callable[[mujoco.MjModel], None] = lambda model: None
    force: Force | None = None
    delay_s: float = 0.0
    lag_s: float = 0.0
    offset: tuple[float, ...] = ()


def _set(name: str, row: int, value: float) -> Callable[[mujoco.MjModel], None]:
    def change(model: mujoco.MjModel) -> None:
        getattr(model, name)[row, ...] = value

    return change


def _scaled_body(body: str, factor: float) -> Callable[[mujoco.MjModel], None]:
    def change(model: mujoco.MjModel) -> None:
        model.body(body).mass[:] *= factor
        model.body(body).inertia[:] *= factor
        mujoco.mj_setConst(model, mujoco.MjData(model))

    return change


def _law(dof: int, law: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Force:
    """A force on one joint by its position and speed."""

    def force(qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        out = np.zeros_like(qvel)
        out[:, dof] = law(qpos[:, dof], qvel[:, dof])
        return out

    return force


def _coulomb(dof: int, torque: float, rate: float) -> Force:
    """Dry friction as a steep smooth law, stepped finely: not MuJoCo's constraint."""
    return _law(dof, lambda q, v: -torque * np.tanh(v / rate))


def _stribeck(dof: int, torque: float, peak: float, speed: float, rate: float) -> Force:
    return _law(
        dof, lambda q, v: -(torque + peak * np.exp(-((v / speed) ** 2))) * np.tanh(v / rate)
    )


CASES = {
    "cart_pole_control": Hidden("cart_pole", ("none",)),
    "cart_pole_dry": Hidden("cart_pole", ("dry_friction_slider",), force=_coulomb(0, 0.8, 0.004)),
    "cart_pole_mass": Hidden("cart_pole", ("mass_pole",), _scaled_body("pole", 1.5)),
    "cart_pole_dead_time": Hidden("cart_pole", ("dead_time_slider",), delay_s=0.04),
    "cart_pole_ripple": Hidden(
        "cart_pole", ("unknown",), force=_law(0, lambda q, v: 1.5 * np.sin(10 * q))
    ),
    "two_link_control": Hidden("two_link", ("none",)),
    "two_link_dry": Hidden("two_link", ("dry_friction_elbow",), force=_coulomb(1, 0.25, 0.02)),
    "two_link_viscous": Hidden(
        "two_link", ("viscous_friction_elbow",), _set("dof_damping", 1, 0.3)
    ),
    "two_link_payload": Hidden("two_link", ("mass_fore",), _scaled_body("fore", 1.6)),
    "two_link_dead_time": Hidden(
        "two_link", ("dead_time_shoulder", "dead_time_elbow"), delay_s=0.05
    ),
    "two_link_offset": Hidden("two_link", ("encoder_offset_shoulder",), offset=(0.08, 0.0)),
    "slider_control": Hidden("slider", ("none",)),
    "slider_dry": Hidden("slider", ("dry_friction_axis",), force=_coulomb(0, 6.0, 0.002)),
    "slider_stribeck": Hidden(
        "slider",
        ("dry_friction_axis", "stribeck_friction_axis"),
        force=_stribeck(0, 4.0, 8.0, 0.3, 0.002),
    ),
    "slider_drag": Hidden("slider", ("drag_axis",), force=_law(0, lambda q, v: -30 * v * abs(v))),
    "slider_gain": Hidden("slider", ("drive_gain_axis",), _set("actuator_gear", 0, 8.0)),
    "slider_lag": Hidden("slider", ("lag_axis",), lag_s=0.05),
}


def make(case: str, folder: Path, seed: int = 0) -> None:
    """Write a folder with a model, logs and robot.yaml; the hidden effect stands nowhere in it."""
    hidden = CASES[case]
    mechanism = MECHANISMS[hidden.mechanism]
    model = mujoco.MjModel.from_xml_string(mechanism.xml)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.xml").write_text(mechanism.xml.strip() + "\n", encoding="utf-8")
    joints = [model.joint(j).name for j in range(model.njnt)]
    drives = [model.actuator(a).name for a in range(model.nu)]
    said = {
        "model": "robot.xml",
        "logs": "log*.csv",
        "time": {"column": "t", "unit": "s"},
        "drive": {f"actuator[{a}]": {"column": f"u_{a}"} for a in drives},
        "measured": {f"joint[{j}].position": {"column": f"q_{j}"} for j in joints},
    }
    (folder / "robot.yaml").write_text(yaml.safe_dump(said, sort_keys=False), encoding="utf-8")
    rng = np.random.default_rng([seed, *case.encode()])
    hidden.change(model)
    model.opt.timestep /= FINER
    model.opt.integrator = int(mujoco.mjtIntegrator.mjINT_RK4)
    logs = _logs(model, mechanism, hidden, rng)
    columns = ["t", *(f"u_{a}" for a in drives), *(f"q_{j}" for j in joints)]
    for number, table in enumerate(logs):
        frame = pl.DataFrame(dict(zip(columns, table.T, strict=True)))
        frame.write_csv(folder / f"log{number:02d}.csv", float_precision=7)


def _logs(
    model: mujoco.MjModel, mechanism: Mechanism, hidden: Hidden, rng: np.random.Generator
) -> np.ndarray:
    """Run all logs side by side: sums of sines as commands, quantised and noisy encoders."""
    batch, n, step_s = Batch(model, LOGS, nthread=1), round(LOG_S / PERIOD_S), model.opt.timestep
    qpos, qvel, ctrl, applied = map(batch.bind, ("qpos", "qvel", "ctrl", "qfrc_applied"))
    t_s = PERIOD_S * np.arange(n)
    command = np.zeros((LOGS, n, model.nu))
    for log, channel, _ in np.ndindex(LOGS, model.nu, 4):
        wave = np.sin(2 * np.pi * (rng.uniform(0.2, 2.0) * t_s + rng.uniform()))
        command[log, :, channel] += mechanism.drive[channel] / 2 * wave
    late, per_sample = round(hidden.delay_s / step_s), round(PERIOD_S / step_s)
    keep = np.exp(-step_s / hidden.lag_s) if hidden.lag_s else 0.0
    reached, seen = command[:, 0], np.empty((LOGS, n, model.nq))
    for step in range(n * per_sample):
        if step % per_sample == 0:
            seen[:, step // per_sample] = qpos
        wanted = command[:, max(step - late, 0) // per_sample]
        reached = wanted + keep * (reached - wanted)
        ctrl[:] = reached
        if hidden.force is not None:
            applied[:] = hidden.force(qpos, qvel)
        batch.step()
    seen += np.array(hidden.offset or np.zeros(model.nq))
    quantum = np.array(mechanism.step)
    seen = np.round((seen + quantum * rng.normal(size=seen.shape)) / quantum) * quantum
    times = np.broadcast_to(t_s[:, None], (LOGS, n, 1))
    return np.concatenate([times, command, seen], axis=-1)


def score(case: str, folder: Path) -> dict:
    """Diagnose one case and say how it went."""
    from robotcast.diagnosis.diagnose import diagnose
    from robotcast.diagnosis.rule import Effort, Rule
    from robotcast.robots.robot_case import read_case

    began = time.monotonic()
    make(case, folder)
    asked = read_case(folder)
    said = diagnose(asked.question((), (), Rule(), Effort()), lambda known: None)
    confused = {e for some in said["confusion_set"] for e in some}
    ladder = [r["heldout_typical_error_percent"] for r in said["ladder"]]
    return {
        "case": case,
        "answer": "+".join(CASES[case].answer),
        "said": "+".join(said["verdict"]) if said["code"] != "cannot tell" else "cannot tell",
        "confused": ", ".join(sorted(confused - set(said["verdict"]))),
        "error": " → ".join(f"{e:.2f}" for e in ladder),
        "floor": round(asked.floor_percent, 2),
        "seconds": round(time.monotonic() - began),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="Diagnose robots with a hidden effect.")
    parser.add_argument("cases", nargs="*", default=list(CASES), metavar="CASE")
    parser.add_argument("--output", type=Path, default=Path("outputs/robots"), metavar="DIR")
    given = parser.parse_args()
    rows = []
    for case in given.cases:
        rows.append(score(case, given.output / case))
        print(json.dumps(rows[-1], ensure_ascii=False), flush=True)
    right = sum(set(row["said"].split("+")) == set(row["answer"].split("+")) for row in rows)
    print(f"{right} of {len(rows)} named as they were hidden")


if __name__ == "__main__":
    main()

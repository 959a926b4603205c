"""Keeps MuJoCo, in this process, from doing what no simulation here needs."""

import mujoco
from numba import cfunc


@cfunc("float64()", cache=True)
def _untimed() -> float:
    return 0.0


def undistracted() -> None:
    """Have MuJoCo neither print what diverged nor read the clock.

    Runs that diverge are marked in the prediction; a line each would only bury the bar. Its
    profiler, on by default in Python, reads the clock about thirty times a step, a tenth of what
    a planar chain takes; `MjData.timer` stays at zero. A timer that somebody has set is kept.
    """
    mujoco.set_mju_user_warning(lambda _: None)
    if mujoco.get_mjcb_time() is None:
        mujoco.set_mjcb_time(_untimed.ctypes)

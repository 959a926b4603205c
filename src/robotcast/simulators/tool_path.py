"""Where the held end is at every step of a simulation, between the logged samples."""

from collections.abc import Sequence

import numpy as np
from numba import njit

from robotcast.casts.tool_motion import ToolMotion


class ToolPaths:
    """The poses of many tools at the same times.

    Cubics between the samples whose slopes there are central differences; at rest before the
    first and after the last sample. They are local, unlike a spline: what a cast gets does not
    depend on the casts it is batched with.

    Parameters
    ----------
    times_s : ndarray of shape (n,).
    """

    def __init__(self, tools: Sequence[ToolMotion], times_s: np.ndarray) -> None:
        t_s, pose = _padded(tools)
        self._cubics = _cubics(t_s, pose)
        first_s, last_s = (np.array([[tool.t_s[k]] for tool in tools]) for k in (0, -1))
        times = np.clip(times_s, first_s, last_s)
        interval = np.stack(
            [np.searchsorted(row, some, "right") - 1 for row, some in zip(t_s, times, strict=True)]
        )
        self._since_s = np.ascontiguousarray((times - np.take_along_axis(t_s, interval, 1)).T)
        self._interval = np.ascontiguousarray(interval.T)

    def at(self, k: int, tools: np.ndarray) -> np.ndarray:
        """Return the poses at time `k` of the tools numbered `tools` (m,), (m, 3)."""
        pose = np.empty((len(tools), 3))
        _evaluate(self._cubics, self._interval[k], self._since_s[k], tools, pose)
        return pose


@njit(nogil=True, cache=True)
def _evaluate(cubics, interval, since_s, tools, pose):
    """Fill `pose` (m, 3) with the cubics of the tools numbered `tools` (m,)."""
    for i in range(tools.size):
        tool = tools[i]
        cubic, since = cubics[tool, interval[tool]], since_s[tool]
        for axis in range(3):
            pose[i, axis] = (
                (cubic[3, axis] * since + cubic[2, axis]) * since + cubic[1, axis]
            ) * since + cubic[0, axis]


def _cubics(t_s: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return the coefficients, lowest power first, of every interval, (n_tools, m − 1, 4, 3)."""
    slope = np.zeros_like(pose)
    slope[:, 1:-1] = (pose[:, 2:] - pose[:, :-2]) / (t_s[:, 2:] - t_s[:, :-2])[:, :, None]
    span_s = np.diff(t_s, axis=1)[:, :, None]
    rise = np.diff(pose, axis=1) / span_s
    start, end = slope[:, :-1], slope[:, 1:]
    square = (3 * rise - 2 * start - end) / span_s
    cube = (start + end - 2 * rise) / span_s**2
    return np.stack([pose[:, :-1], start, square, cube], axis=2)


def _padded(tools: Sequence[ToolMotion]) -> tuple[np.ndarray, np.ndarray]:
    """Return times (n_tools, m) and poses (n_tools, m, 3), at rest before and after each tool."""
    longest = max(len(tool.t_s) for tool in tools)
    t_s = np.empty((len(tools), longest + 2))
    pose = np.empty((len(tools), longest + 2, 3))
    for k, tool in enumerate(tools):
        n = len(tool.t_s)
        t_s[k, 0] = tool.t_s[0] - 1.0
        t_s[k, 1 : n + 1] = tool.t_s
        t_s[k, n + 1 :] = tool.t_s[-1] + np.arange(1, longest - n + 2)
        pose[k, 0] = tool.pose[0]
        pose[k, 1 : n + 1] = tool.pose
        pose[k, n + 1 :] = tool.pose[-1]
    return t_s, pose

"""Where the held end is at every step of a simulation, between the logged samples."""

from collections.abc import Sequence

import numpy as np

from robotcast.casts.tool_motion import ToolMotion


def tool_poses(tools: Sequence[ToolMotion], times_s: np.ndarray) -> np.ndarray:
    """Return the poses of all `tools` at `times_s` (n,), (n, n_tools, 3).

    Cubics between the samples whose slopes there are central differences; at rest before the
    first and after the last sample. They are local, unlike a spline: what a cast gets does not
    depend on the casts it is batched with.
    """
    t_s, pose = _padded(tools)
    slope = np.zeros_like(pose)
    slope[:, 1:-1] = (pose[:, 2:] - pose[:, :-2]) / (t_s[:, 2:] - t_s[:, :-2])[:, :, None]
    first_s, last_s = (np.array([[tool.t_s[k]] for tool in tools]) for k in (0, -1))
    times = np.clip(times_s, first_s, last_s)
    i = np.stack(
        [np.searchsorted(row, some, "right") - 1 for row, some in zip(t_s, times, strict=True)]
    )
    row = np.arange(len(tools))[:, None]
    start_s, span_s = t_s[row, i], t_s[row, i + 1] - t_s[row, i]
    u = ((times - start_s) / span_s)[:, :, None]
    rise = pose[row, i + 1] - pose[row, i]
    bend = slope[row, i] * span_s[:, :, None] - rise
    unbend = rise - slope[row, i + 1] * span_s[:, :, None]
    path = pose[row, i] + u * rise + u * (1 - u) * ((1 - u) * bend + u * unbend)
    return np.ascontiguousarray(path.transpose(1, 0, 2))


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

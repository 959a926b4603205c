"""What a webcam over the peer sees, served as an MJPEG stream over HTTP.

The arm is drawn where the controller has it. The cable is the virtual rig's; it is simulated
while the held end moves over the board. Resets are not: when the arm comes home, the cable lies
as a reset should leave it; so it does where an operator put the arm. Frames follow the
controller's clock: it waits while one is drawn.
"""

import socket
from collections import deque

import cv2
import numpy as np

from robotcast.rigs.kinematics import joints_pointing_down, link_points
from robotcast.rigs.virtual.cable import CableRun, build_cable, compile_cable, nodes
from robotcast.rigs.virtual.picture import SceneMotion, frames
from robotcast.rigs.virtual.rig import VirtualRig

PORT = 8090
BOUNDARY = b"frame"
HOME_M, LIFTED_M = 0.002, 0.01
HALF_CYCLE_S = 0.001
PUT_M = 0.05  # no arm moves its tool so far in one cycle


class Film:
    """The camera of a rig and its stream, each frame late by `delay_s` of the controller's time."""

    def __init__(self, rig: VirtualRig, delay_s: float, host: str) -> None:
        self.rig, self.delay_s = rig, delay_s
        self.address = f"http://{host}:{PORT}/film.mjpg"
        self.gone, self.heading_rad = False, 0.0
        self._server = socket.create_server((host, PORT))
        self._server.setblocking(False)
        self._viewers: list[socket.socket] = []
        self._waiting: deque[tuple[float, bytes]] = deque()
        self._next_s, self._seed = 0.0, 0
        self._cable: CableRun | None = None
        self._nodes_m = np.zeros((0, 3))
        self._at_home = False
        # Paint the scene once, which takes seconds, before anybody waits for a frame.
        home = joints_pointing_down(np.array([rig.r0_m, 0.0, 0.0]), rig.gripper)
        self._path: list[tuple[float, np.ndarray]] = [(0.0, home)]
        self._move_cable(home)
        self._draw(home)

    def cycle(self, t_s: float, joints: np.ndarray) -> None:
        """See the arm at `t_s`; send what is due."""
        self._path.append((t_s, joints))
        self._admit()
        if t_s >= self._next_s - HALF_CYCLE_S:
            self._next_s += 1 / self.rig.picture.fps
            if self._viewers and not self.gone:
                self._move_cable(joints)
                self._waiting.append((t_s + self.delay_s, self._draw(joints)))
            self._path = self._path[-1:]
        while self._waiting and t_s >= self._waiting[0][0] - HALF_CYCLE_S:
            self._send(self._waiting.popleft()[1])

    def _draw(self, joints: np.ndarray) -> bytes:
        rig = self.rig
        span_s = np.array([0.0, rig.picture.exposure_s + 0.5 / rig.picture.fps])
        scene = SceneMotion(
            span_s,
            np.stack([self._nodes_m] * 2),
            np.stack([link_points(joints, rig.gripper)] * 2),
            rig.cable.radius_m,
            rig.truth.endpoint_radius_m,
        )
        self._seed += 1
        picture = next(frames(scene, rig.camera, rig.picture, self._seed))
        return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()

    def _move_cable(self, joints: np.ndarray) -> None:
        rig = self.rig
        held = _held(joints, rig)
        at_home = bool(np.hypot(held[0] - rig.r0_m, held[1]) < HOME_M and held[2] < HOME_M)
        poses = np.array([_held(q, rig) for _, q in self._path])
        put = bool((np.abs(np.diff(poses[:, :3], axis=0)) > PUT_M).any())
        if self._cable is None or put or (at_home and not self._at_home):
            headings = np.full(rig.truth.segments, self.heading_rad)
            model = compile_cable(build_cable(rig.cable, rig.truth))
            self._cable = CableRun(model, headings, held)
        elif held[2] < LIFTED_M and not at_home:
            t_s = np.array([t for t, _ in self._path])
            steps = np.arange(t_s[0], t_s[-1], rig.truth.step_s)
            path = np.stack([np.interp(steps, t_s, column) for column in poses.T], axis=1)
            self._cable.drive(path, moving_s=np.inf)
        self._at_home = at_home
        self._nodes_m = nodes(self._cable.model, self._cable.data)

    def _admit(self) -> None:
        try:
            viewer, _ = self._server.accept()
        except BlockingIOError:
            return
        viewer.settimeout(1.0)
        kind = b"Content-Type: multipart/x-mixed-replace; boundary=" + BOUNDARY
        try:
            viewer.recv(4096)
            viewer.sendall(b"HTTP/1.0 200 OK\r\n" + kind + b"\r\n\r\n")
        except OSError:
            viewer.close()
            return
        self._viewers.append(viewer)

    def _send(self, jpeg: bytes) -> None:
        if self.gone:
            return
        head = b"--%s\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n"
        part = head % (BOUNDARY, len(jpeg)) + jpeg + b"\r\n"
        for viewer in list(self._viewers):
            try:
                viewer.sendall(part)
            except OSError:
                self._viewers.remove(viewer)
                viewer.close()


def _held(joints: np.ndarray, rig: VirtualRig) -> np.ndarray:
    """Return x, y, height above the resting height, yaw and pitch of the held end."""
    x, y, z = link_points(joints, rig.gripper)[-1]
    return np.array([x, y, z - rig.gripper.held_height_m, joints[0] - np.pi / 2 - joints[5], 0.0])

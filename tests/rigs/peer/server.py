"""The peer's sockets and its clock: dashboard, script port and RTDE in one thread."""

import selectors
import socket
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING

import numpy as np

from tests.rigs.peer import rtde
from tests.rigs.peer.controller import (
    INPUT_TYPES,
    OUTPUTS,
    STEP_S,
    VERSION,
    Arm,
    Controller,
    Settings,
)

if TYPE_CHECKING:
    from tests.rigs.peer.film import Film

DASHBOARD, SCRIPT, DATA = 29999, 30003, 30004
PORTS = (DASHBOARD, 30001, 30002, SCRIPT, DATA)
LOOK_S = 0.005  # how often it looks up while it waits for a target
CONTROL_PROGRAM, PROGRAM_END = b"rtde_control", b"NODE_CONTROL_LOOP_ENDS"


@dataclass
class _Client:
    """One connection, and for RTDE what it asked for."""

    port: int
    received: bytearray = field(default_factory=bytearray)
    outputs: list[str] = field(default_factory=list)
    inputs: list[list[str]] = field(default_factory=list)
    started: bool = False


def listen(host: str) -> list[socket.socket]:
    """Listen on every port of a controller at `host`; OSError when one is taken."""
    with ExitStack() as opened:
        sockets = [opened.enter_context(socket.create_server((host, port))) for port in PORTS]
        opened.pop_all()
    return sockets


class Server:
    """A controller on its ports; commands from the test arrive through `orders`."""

    def __init__(
        self,
        sockets: list[socket.socket],
        settings: Settings,
        orders: Connection,
        film: "Film | None",
    ) -> None:
        self.controller, self._film = Controller(settings), film
        self._selector = selectors.DefaultSelector()
        self._clients: dict[socket.socket, _Client] = {}
        self._deaf = self._silent = False
        self._frozen: dict[str, object] | None = None
        self._due: list[tuple[float, str]] = []
        for listening in sockets:
            listening.setblocking(False)
            self._selector.register(listening, selectors.EVENT_READ, self._accept)
        self._selector.register(orders, selectors.EVENT_READ, self._obey)
        self._silence_s = 0.0
        self._running = True

    def run(self) -> None:
        """Serve until told to end. A late cycle shifts the clock: none is made up in haste."""
        step_s = STEP_S / self.controller.settings.haste
        due = time.monotonic() + step_s
        while self._running:
            wait_s = max(due - time.monotonic(), LOOK_S if self._patient() else 0.0)
            for key, _ in self._selector.select(wait_s):
                key.data(key.fileobj)
            if time.monotonic() >= due and not self._patient():
                self._cycle()
                due = max(due + step_s, time.monotonic() + step_s / 2)
        for client in list(self._clients):
            self._drop(client)

    def _patient(self) -> bool:
        """Tell whether to wait on for servoj's next target; patience is once for every silence."""
        now = time.monotonic()
        if not self.controller.awaits_target():
            self._silence_s = now
            return False
        return now < self._silence_s + self.controller.settings.patience_s

    def _cycle(self) -> None:
        controller = self.controller
        controller.cycle()
        if self._film is not None:
            self._film.cycle(controller.t_s, controller.arm.joints)
        for at_s, kind in [d for d in self._due if d[0] <= controller.t_s]:
            self._due.remove((at_s, kind))
            self._break(kind)
        for sock, client in list(self._clients.items()):
            if client.started and not self._silent:
                types = [OUTPUTS[name][0] for name in client.outputs]
                values = [self._value(name) for name in client.outputs]
                self._send(sock, rtde.message(rtde.DATA, bytes([1]) + rtde.pack(types, values)))

    def _value(self, name: str) -> object:
        value = OUTPUTS[name][1](self.controller)
        if self._frozen is not None and not name.startswith("output_"):
            return self._frozen.setdefault(name, value)
        return value

    def _accept(self, listening: socket.socket) -> None:
        sock, _ = listening.accept()
        if self._deaf:
            sock.close()
            return
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client = _Client(listening.getsockname()[1])
        self._clients[sock] = client
        self._selector.register(sock, selectors.EVENT_READ, self._hear)
        if client.port == DASHBOARD:
            self._send(sock, b"Connected: Universal Robots Dashboard Server\n")

    def _hear(self, sock: socket.socket) -> None:
        client = self._clients.get(sock)
        if client is None:
            return
        try:
            data = sock.recv(65536)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._drop(sock)
            return
        client.received += data
        if client.port == DATA:
            for kind, payload in rtde.take_messages(client.received):
                self._answer(sock, client, kind, payload)
        elif client.port == DASHBOARD:
            while b"\n" in client.received:
                line, _, rest = client.received.partition(b"\n")
                client.received = rest
                self._send(sock, (self._dashboard(line.decode().strip()) + "\n").encode())
        elif CONTROL_PROGRAM in client.received and PROGRAM_END in client.received:
            client.received.clear()
            self.controller.start_program()

    def _answer(self, sock: socket.socket, client: _Client, kind: int, payload: bytes) -> None:
        if kind == rtde.VERSION:
            self._send(sock, rtde.message(kind, bytes([payload[-1] == 2])))
        elif kind == rtde.CONTROLLER:
            self._send(sock, rtde.message(kind, rtde.pack(["UINT32"] * 4, VERSION)))
        elif kind == rtde.OUTPUTS:
            client.outputs = payload[8:].decode().strip(",").split(",")
            types = ",".join(OUTPUTS[name][0] for name in client.outputs).encode()
            self._send(sock, rtde.message(kind, bytes([1]) + types))
        elif kind == rtde.INPUTS:
            names = payload.decode().strip(",").split(",")
            client.inputs.append(names)
            types = ",".join(INPUT_TYPES[name] for name in names).encode()
            self._send(sock, rtde.message(kind, bytes([len(client.inputs)]) + types))
        elif kind in (rtde.START, rtde.PAUSE):
            client.started = kind == rtde.START
            self._send(sock, rtde.message(kind, bytes([1])))
        elif kind == rtde.DATA:
            names = client.inputs[payload[0] - 1]
            types = [INPUT_TYPES[name] for name in names]
            self.controller.receive(names, rtde.unpack_scalars(types, payload[1:]))

    def _dashboard(self, line: str) -> str:
        if line == "stop":
            self.controller.stop_program()
            return "Stopped"
        if line == "PolyscopeVersion":
            return f"URSoftware {'.'.join(map(str, VERSION))} (Apr 01 2021)"
        return f"could not understand: '{line}'"

    def _obey(self, orders: Connection) -> None:
        name, *values = orders.recv()
        answer: object = None
        if name == "break":
            self._break(values[0])
        elif name == "break in":
            self._due.append((self.controller.t_s + values[1], values[0]))
        elif name == "mend":
            if self._film is not None:
                self._film.gone, self._film.heading_rad = False, 0.0
            self._deaf = self._silent = False
            self._frozen = None
            self._due.clear()
            self.controller.release()
        elif name == "hurry":
            for _ in range(round(values[0] / STEP_S)):
                self._cycle()
        elif name == "place":
            self.controller.arm = Arm(values[0])
        elif name == "log":
            answer = self.controller.log
        elif name == "end":
            self._running = False
        orders.send(answer)

    def _break(self, kind: str) -> None:
        self.controller.log.faults.append((self.controller.t_s, kind))
        if kind in ("protective stop", "emergency stop"):
            self.controller.stop_for_safety(kind)
        elif kind == "connection cut":
            self._deaf = True
            for sock in list(self._clients):
                self._drop(sock)
        elif kind == "stale packets":
            self._frozen = {}
        elif kind == "packets missing":
            self._silent = True
        elif kind == "camera gone" and self._film is not None:
            self._film.gone = True
        elif kind == "cable crooked" and self._film is not None:
            self._film.heading_rad = 1.2
        elif kind == "off its path":
            self.controller.arm.drift = np.array([0.15, 0.0, 0.0, 0.0, 0.0, 0.0])
        else:
            raise ValueError(f"peer: no fault called {kind}")

    def _send(self, sock: socket.socket, data: bytes) -> None:
        try:
            sock.sendall(data)
        except OSError:
            self._drop(sock)

    def _drop(self, sock: socket.socket) -> None:
        if self._clients.pop(sock, None) is not None:
            self._selector.unregister(sock)
            sock.close()

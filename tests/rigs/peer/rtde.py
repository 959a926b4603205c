"""The messages of Universal Robots' Real-Time Data Exchange, protocol version 2.

After the RTDE guide of Universal Robots: a message is its size (uint16, header included), its
type (uint8) and a payload, all big-endian. A client asks for the protocol version, sets up one
recipe of outputs and several of inputs, starts, and then receives one data package a cycle.
"""

import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

VERSION, CONTROLLER, TEXT, DATA = ord("V"), ord("v"), ord("M"), ord("U")
OUTPUTS, INPUTS, START, PAUSE = ord("O"), ord("I"), ord("S"), ord("P")

FORMATS = {
    "DOUBLE": "d",
    "INT32": "i",
    "UINT32": "I",
    "UINT64": "Q",
    "UINT8": "B",
    "VECTOR6D": "6d",
    "VECTOR3D": "3d",
    "VECTOR6INT32": "6i",
}

OUTPUT_TYPES = {
    "timestamp": "DOUBLE",
    "target_q": "VECTOR6D",
    "target_qd": "VECTOR6D",
    "actual_q": "VECTOR6D",
    "actual_qd": "VECTOR6D",
    "actual_TCP_pose": "VECTOR6D",
    "speed_scaling": "DOUBLE",
    "target_speed_fraction": "DOUBLE",
    "robot_mode": "INT32",
    "safety_mode": "INT32",
    "runtime_state": "UINT32",
    "robot_status_bits": "UINT32",
    "safety_status_bits": "UINT32",
    **{f"output_int_register_{i}": "INT32" for i in range(48)},
    **{f"output_double_register_{i}": "DOUBLE" for i in range(48)},
}
"""Of the guide's outputs those that a client of this project may ask for."""

INPUT_TYPES = {
    "speed_slider_mask": "UINT32",
    "speed_slider_fraction": "DOUBLE",
    "external_force_torque": "VECTOR6D",
    **{f"input_int_register_{i}": "INT32" for i in range(48)},
    **{f"input_double_register_{i}": "DOUBLE" for i in range(48)},
}


def message(kind: int, payload: bytes = b"") -> bytes:
    """Return a message with its header."""
    return struct.pack(">HB", 3 + len(payload), kind) + payload


def take_messages(buffer: bytearray) -> Iterator[tuple[int, bytes]]:
    """Take the whole messages out of what was received so far."""
    while len(buffer) >= 3:
        size, kind = struct.unpack_from(">HB", buffer)
        if len(buffer) < size:
            return
        payload = bytes(buffer[3:size])
        del buffer[:size]
        yield kind, payload


def pack(types: Sequence[str], values: Sequence[Any]) -> bytes:
    """Pack values of these types."""
    flat: list[Any] = []
    for value in values:
        flat.extend(value) if hasattr(value, "__len__") else flat.append(value)
    return struct.pack(">" + "".join(FORMATS[t] for t in types), *flat)


def unpack_scalars(types: Sequence[str], payload: bytes) -> list[float]:
    """Unpack values; of a vector only its parts, one after another."""
    return list(struct.unpack(">" + "".join(FORMATS[t] for t in types), payload))


def types_of(names: Sequence[str], known: Mapping[str, str]) -> list[str]:
    """Return the type of each variable, NOT_FOUND where there is none."""
    return [known.get(name, "NOT_FOUND") for name in names]

"""The messages of Universal Robots' Real-Time Data Exchange, protocol version 2.

After the RTDE guide of Universal Robots: a message is its size (uint16, header included), its
type (uint8) and a payload, all big-endian. A client asks for the protocol version, sets up one
recipe of outputs and several of inputs, starts, and then receives one data package a cycle.
"""

import struct
from collections.abc import Iterator, Sequence
from typing import Any

VERSION, CONTROLLER, TEXT, DATA = ord("V"), ord("v"), ord("M"), ord("U")
OUTPUTS, INPUTS, START, PAUSE = ord("O"), ord("I"), ord("S"), ord("P")

FORMATS = {"DOUBLE": "d", "INT32": "i", "UINT32": "I", "VECTOR6D": "6d"}


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

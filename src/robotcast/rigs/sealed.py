"""Answers that nobody shall read by accident: what was hidden from a diagnosis."""

import base64
import binascii
import json
import zlib
from pathlib import Path
from typing import Any

from robotcast.files import write_text


def seal(answer: dict[str, Any], path: Path) -> None:
    """Write an answer so that nobody reads it by accident; the same one gives the same bytes."""
    packed = zlib.compress(json.dumps(answer, sort_keys=True).encode(), level=9)
    write_text(path, base64.encodebytes(packed).decode())


def unseal(path: Path) -> dict[str, Any]:
    """Read an answer that `seal` wrote."""
    try:
        return json.loads(zlib.decompress(base64.decodebytes(path.read_bytes())))
    except (binascii.Error, zlib.error, ValueError):
        raise ValueError(f"{path}: is not a sealed answer") from None

"""Writing to disk so that a reader, or a rerun after a kill, never meets half a file.

And YAML as people write it, answers that nobody shall read by accident, and the fingerprint of
the code.
"""

import base64
import binascii
import glob
import hashlib
import json
import math
import os
import shutil
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import yaml


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path` that becomes `path` when the block succeeds."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp{path.suffix}")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path` in one step."""
    with atomic_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_yaml(path: Path, values: Any) -> None:
    """Write plain values as YAML in one step, keys in the order that they have."""
    write_text(path, yaml.safe_dump(values, sort_keys=False))


def read_mapping(path: Path, expected: str) -> dict[str, Any]:
    """Read a YAML file of keys; a ValueError names the line where it is none, or what it needs."""
    try:
        found = yaml.safe_load(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        raise ValueError(f"{path}: is not text in UTF-8") from None
    except (yaml.YAMLError, ValueError, AttributeError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        place = f"{path} line {mark.line + 1}" if mark else f"{path}"
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise ValueError(f"{place}: is not YAML ({problem})") from None
    if not isinstance(found, dict):
        raise ValueError(f"{path}: expected {expected}, got {found!r:.40}")
    return found


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Yield an empty folder beside `path` that becomes `path` when the block succeeds.

    `path` must not exist yet: a folder of finished data is never replaced.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir()
    try:
        yield temporary
        os.rename(temporary, path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def discard_unfinished(folder: Path, name: str | None = None) -> None:
    """Remove what killed writers left behind in `folder`.

    With a `name`, only what writers of that entry left: others may be at work in the folder.
    """
    of = "*" if name is None else glob.escape(name)
    for leftover in list(folder.glob(f".{of}.*.tmp*")):
        if leftover.is_dir():
            shutil.rmtree(leftover, ignore_errors=True)
        else:
            leftover.unlink(missing_ok=True)


DIGITS = 6


def plain(value: Any) -> Any:
    """Return `value` with arrays as lists, six significant digits, and None for NaN or infinity."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(some) for key, some in value.items()}
    if isinstance(value, list | tuple):
        return [plain(some) for some in value]
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
    return value


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


def digest(*parts: object) -> str:
    """Return a fingerprint: of arrays and bytes as they are, of all else by its text."""
    found = hashlib.sha256()
    for part in parts:
        raw = np.ascontiguousarray(part).tobytes() if isinstance(part, np.ndarray) else part
        found.update(raw if isinstance(raw, bytes) else str(raw).encode())
    return found.hexdigest()


def source_digest(*rooms: str, root: Path = Path(__file__).parent) -> str:
    """Return a digest of all modules below the folders `rooms` of `root`."""
    paths = [path for room in rooms for path in sorted((root / room).rglob("*.py"))]
    return digest(*(b"%s\n%s" % (str(p.relative_to(root)).encode(), p.read_bytes()) for p in paths))

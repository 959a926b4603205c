"""Meshes that a URDF names by their ROS package."""

from pathlib import Path
from typing import Any

SCHEME = "package://"


def find_meshes(spec: Any, path: Path) -> None:
    """Write where meshes of packages lie into a spec: in a folder above the file, or below one.

    Raises
    ------
    ValueError
        For one that is not there.
    """
    for mesh in spec.meshes:
        if not mesh.file.startswith(SCHEME):
            continue
        package, _, inside = mesh.file.removeprefix(SCHEME).partition("/")
        above = path.resolve().parents
        places = [place for folder in above for place in (folder / package, folder)]
        found = [place / inside for place in places if (place / inside).is_file()]
        if not found:
            raise ValueError(
                f"{path}: there is no mesh {mesh.file}; copy the folder {package}/ of that package "
                "beside the file"
            )
        mesh.file = str(found[0])

"""Mesh files: points and triangles, and why a file holds none."""

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

MESHES = (".obj", ".stl", ".gltf", ".glb")
_Y_UP = (".gltf", ".glb")  # whose y points upwards, as the format says; that of all others is taken as it is


class MeshError(ValueError):
    """A file is missing or holds no mesh."""


def read_mesh(file: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) and the indices of the corners of triangles (m, 3), both not to be written to.

    Raises:
        MeshError: if there is no such file, or it holds no mesh.
    """
    path = Path(file)
    if path.suffix.lower() not in MESHES:
        raise MeshError(f"a mesh must end in {', '.join(MESHES)}, got {path}")
    try:
        state = path.stat()
    except OSError as error:
        raise MeshError(f"no mesh {path}: {(error.strerror or str(error)).lower()}") from error
    return _read(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=64)  # robots are loaded again and again; a file that has changed is another one
def _read(path: Path, _changed: int, _size: int) -> tuple[np.ndarray, np.ndarray]:
    import trimesh  # here, because it takes a tenth of a second that only meshes need

    try:
        mesh: Any = trimesh.load(path, force="mesh")
        points, faces = np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=int)
    except Exception as error:  # whatever a reader of someone else makes of a broken file
        reason = " ".join(str(error).split()) or type(error).__name__
        raise MeshError(f"{path} holds no mesh that can be read: {reason}") from error
    if not len(faces):
        raise MeshError(f"{path} holds no triangles")
    if not np.isfinite(points[faces]).all():
        raise MeshError(f"{path} has corners that are no numbers")
    if path.suffix.lower() in _Y_UP:
        x, y, z = points.T
        points = np.stack([x, -z, y], -1)
    points.flags.writeable = faces.flags.writeable = False
    return points, faces

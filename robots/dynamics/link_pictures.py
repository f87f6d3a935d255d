"""The shapes of a robot file as what a viewer shows of a body."""

from pathlib import Path

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import Box, Cylinder, InMemoryMesh, Mesh, Rgba, Shape, Sphere
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from robots.description.model import Link
from robots.description.placement import Picture


def add_pictures(plant: MultibodyPlant, body: RigidBody, link: Link, color: Rgba) -> bool:
    """Pictures a body by the shapes of its link.

    Args:
        plant: with a SceneGraph.
        body: which is the whole link.
        link: whose pictures are added.
        color: of what has none of its own.

    Returns:
        Whether all of its shapes are there; if a file is missing, nothing was added.
    """
    pictures = link.pictures
    if not pictures or any(p.shape == "mesh" and not Path(p.file).is_file() for p in pictures):
        return False
    for number, picture in enumerate(pictures, 1):
        name = f"{body.name()}_picture_{number}"
        plant.RegisterVisualGeometry(body, picture.placement.pose(), _shape(picture), name, color.rgba)
    return True


def _shape(picture: Picture) -> Shape:
    size = picture.size
    if picture.shape == "box":
        return Box(size)
    if picture.shape == "cylinder":
        return Cylinder(*size)
    if picture.shape == "sphere":
        return Sphere(size[0])
    return _mesh(Path(picture.file), np.array(size))


def _mesh(path: Path, scale: np.ndarray) -> Mesh:
    """A mesh; Meshcat shows no STL, so that one is handed on as OBJ."""
    if path.suffix.lower() != ".stl":
        return Mesh(path, scale)
    import trimesh  # here, because it takes a tenth of a second that only STL needs

    text = str(trimesh.load_mesh(path).export(file_type="obj"))
    return Mesh(InMemoryMesh(mesh_file=MemoryFile(text, ".obj", path.name)), scale)

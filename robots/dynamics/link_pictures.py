"""The shapes of a robot file as what a viewer shows of a body."""

from pathlib import Path

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import Box, Cylinder, InMemoryMesh, Mesh, Rgba, Shape, Sphere
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from robots.description.model import Link
from robots.description.pictures.picture import Picture


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
    return drakes_mesh(picture)


def drakes_mesh(picture: Picture) -> Mesh:
    """A mesh; only OBJ, which may have colours, is read by Meshcat: it takes no STL and no GLB."""
    path = Path(picture.file)
    if path.suffix.lower() == ".obj":
        return Mesh(path, np.array(picture.size))
    points, faces = picture.triangles()
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    return Mesh(InMemoryMesh(mesh_file=MemoryFile("\n".join(lines), ".obj", path.name)))

"""What pictures a body in a viewer, in place of a capsule. Nothing else depends on it."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from robots.configuration.nodes import Node
from robots.configuration.quantity import choice, numbers
from robots.description.pictures.mesh_file import MeshError, read_mesh
from robots.description.placement import Placement

SHAPES = {"mesh": 3, "box": 3, "cylinder": 2, "sphere": 1}  # and how many numbers say their size
_WIDEST = 20.0  # m: no link of a robot is that wide; a mesh in millimetres is


@dataclass
class Picture:
    """A shape that a viewer shows for a link, in place of a capsule."""

    shape: str = choice("mesh", SHAPES)  # what is drawn
    file: str = ""  # of a mesh: .obj, .stl, .gltf or .glb; a path begins where the robot file is
    # m: edges of a box, radius and length of a cylinder, radius of a sphere; factors of a mesh along x, y, z
    size: list[float] = numbers([1.0, 1.0, 1.0], (1, 2, 3))
    placement: Placement = field(default_factory=Placement)  # in the frame of the link

    def problem(self) -> str:
        """Why there is no such shape, or an empty string."""
        if len(self.size) != SHAPES[self.shape]:
            return f"the size of a {self.shape} needs {SHAPES[self.shape]} numbers, got {self.size}"
        if self.shape == "mesh":
            return self._problem_of_mesh()
        return "" if min(self.size) > 0.0 else f"the size of a {self.shape} must be positive, got {self.size}"

    def triangles(self) -> tuple[np.ndarray, np.ndarray]:
        """Points of a mesh in its own frame in m, (n, 3), and indices of the corners of triangles, (m, 3).

        Raises:
            MeshError: if there is no such file, or it holds no mesh.
        """
        points, faces = read_mesh(self.file)
        is_mirrored = np.prod(self.size) < 0.0  # what was outside must not become the inside
        return points * np.array(self.size), faces[:, ::-1] if is_mirrored else faces

    def _problem_of_mesh(self) -> str:
        if not self.file:
            return "a mesh needs a file"
        if 0.0 in self.size:
            return f"no factor of a mesh may be zero, got {self.size}"
        try:
            points, faces = self.triangles()
        except MeshError as error:
            return str(error)
        width = float(np.ptp(points[faces].reshape(-1, 3), axis=0).max())
        if width > _WIDEST:
            return f"{self.file} is {width:.4g} m wide; of one in mm the size is [0.001, 0.001, 0.001]"
        return ""


def with_paths_from(folder: Path, robot: Node) -> Node:
    """The nodes of a robot file in which paths of meshes that begin in its folder are whole ones."""
    return _changed(
        robot,
        base_link=lambda link: _in_link(folder, link),
        links=lambda links: _each(links, lambda link: _in_link(folder, link)),
    )


def _in_link(folder: Path, link: Node) -> Node:
    def whole(file: Node) -> Node:
        is_path = isinstance(file.value, str) and file.value
        return Node(str((folder / file.value).resolve()), file.place) if is_path else file

    return _changed(link, pictures=lambda all_: _each(all_, lambda each: _changed(each, file=whole)))


def _changed(node: Node, **changes: Any) -> Node:
    """A mapping with other entries where it has some; anything else as it is."""
    if not isinstance(node.value, dict) or not changes.keys() & node.value.keys():
        return node
    entries = {key: changes[key](each) if key in changes else each for key, each in node.value.items()}
    return Node(entries, node.place, node.tag, node.aside)


def _each(node: Node, change: Any) -> Node:
    """A list with every entry changed; anything else as it is."""
    if not isinstance(node.value, list):
        return node
    return Node([change(each) for each in node.value], node.place, node.tag, node.aside)

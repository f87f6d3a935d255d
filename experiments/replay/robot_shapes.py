"""A robot as what a viewer needs to draw it: its frames, and the shapes of its bodies."""

import math
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from experiments.report.curves import coded, rounded
from robots.description.model import NUM_JOINTS, Link, RobotModel
from robots.description.pictures.mesh_file import MeshError
from robots.description.pictures.picture import Picture

MOST_FACES = 12000  # of all meshes of a robot: without a graphics card each one costs a browser time
_FINEST = 1.0 / 500.0  # of the width of a mesh: cubes within which its points become one
_COARSER = 1.2  # until it is coarse enough
_BODIES = NUM_JOINTS + 1
_DIGITS = 7
LINK, BASE, FLANGE, TOOL = "link", "base", "flange", "tool"


def robot_shapes(robot: RobotModel) -> dict[str, Any]:
    """Frames and shapes of a robot, as plain data.

    Frames are homogeneous matrices, row by row, in m. Without pictures of its own a link is a capsule from
    its joint to the next one; flange and tool are drawn in any case.

    Args:
        robot: with the geometry that is to be seen.

    Returns:
        ``base`` and ``tool``: frames; ``joints``: for each its ``placement`` and ``axis``; ``bodies``: base
        and six links, each a list of shapes with ``kind``, ``frame``, ``size`` and ``part``; ``meshes``.
    """
    ends = [joint.placement.translation for joint in robot.joints]
    links = [robot.base_link, *robot.links]
    tips = [*ends, np.zeros(3)]
    meshes: list[dict[str, Any]] = []
    count = sum(picture.shape == "mesh" for link in links for picture in link.pictures)
    most_faces = MOST_FACES // max(_BODIES, count)
    bodies = [
        _body(number, link, np.asarray(tip), meshes, most_faces)
        for number, (link, tip) in enumerate(zip(links, tips, strict=True))
    ]
    X_FE = robot.tool.pose()
    radius = 0.6 * robot.links[-1].radius
    bodies[-1].append(_between(np.zeros(3), -0.25 * radius * robot.axes[-1], radius, FLANGE, "cylinder"))
    bodies[-1].append(_between(np.zeros(3), X_FE.translation(), 0.35 * radius, TOOL, "cone"))
    return {
        "base": _frame(robot.base.pose()),
        "tool": _frame(X_FE),
        "joints": [
            {"placement": _frame(joint.placement.pose()), "axis": rounded(axis, _DIGITS)}
            for joint, axis in zip(robot.joints, robot.axes, strict=True)
        ],
        "bodies": [[shape for shape in body if shape] for body in bodies],
        "meshes": meshes,
    }


def _body(
    number: int, link: Link, tip: np.ndarray, meshes: list[dict[str, Any]], most_faces: int
) -> list[dict[str, Any]]:
    pictures, part = link.pictures, LINK if number else BASE
    if not pictures:
        return _capsule(number, tip, link.radius, part)
    shapes: list[dict[str, Any]] = []
    for picture in pictures:
        shape: dict[str, Any] = {
            "kind": picture.shape,
            "frame": _frame(picture.placement.pose()),
            "part": part,
        }
        if picture.shape == "mesh":
            try:
                mesh = _mesh(picture, most_faces)
            except MeshError:  # it has changed since the robot was loaded
                return _capsule(number, tip, link.radius, part)
            shapes.append(shape | {"mesh": len(meshes)})
            meshes.append(mesh)
        else:
            shapes.append(shape | {"size": list(picture.size)})
    return shapes


def _capsule(number: int, tip: np.ndarray, radius: float, part: str) -> list[dict[str, Any]]:
    """From a joint to the next one: the base stands flat, the wrist does not reach over the flange."""
    length = float(np.linalg.norm(tip))
    if number == 0:
        return [
            _between(np.zeros(3), tip, radius, part, "cylinder"),
            _between(0.99 * tip, tip, radius, part, "capsule"),
        ]
    if number == NUM_JOINTS - 1 and length > 0.0:
        end = tip * max(1e-3, 1.0 - radius / length)
        slim = min(radius, 0.9 * length)
        return [
            _between(np.zeros(3), end, slim, part, "capsule"),
            _between(end, tip, 0.8 * slim, part, "cylinder"),
        ]
    return [_between(np.zeros(3), tip, radius, part, "capsule")]


def _mesh(picture: Picture, most_faces: int) -> dict[str, Any]:
    """Points and triangles of a mesh file, coarse enough for a page."""
    points, faces = fine = picture.triangles()
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    surface = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    cell = max(_FINEST * float(np.ptp(points, axis=0).max()), math.sqrt(surface / max(1, most_faces)))
    while len(faces) > most_faces:
        points, faces = _merged(*fine, cell)
        cell *= _COARSER
    return {
        "points": [coded(points[:, axis]) for axis in range(3)],
        "faces": coded(faces.reshape(-1), is_whole=True),
    }


def _merged(points: np.ndarray, faces: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """A mesh whose points within a cube of edge ``cell`` are one, in the middle of them."""
    _, member, count = np.unique(
        _keys(np.floor((points - points.min(axis=0)) / cell)), return_inverse=True, return_counts=True
    )
    sums = np.stack([np.bincount(member, points[:, axis]) for axis in range(3)], -1)
    faces = member[faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (a != c)]
    # Many small triangles become the same one, whichever corner is the first; its other side is another one.
    turns = (np.argmin(faces, axis=1)[:, None] + np.arange(3)) % 3
    faces = np.take_along_axis(faces, turns, axis=1)
    _, different = np.unique(_keys(faces), return_index=True)
    return sums / count[:, None], faces[different]


def _keys(rows: np.ndarray) -> np.ndarray:
    """A number for each row (n, 3) of whole numbers from zero on, the same only for the same rows."""
    rows = rows.astype(int)
    return np.asarray(np.ravel_multi_index(tuple(rows.T), tuple(rows.max(axis=0, initial=0) + 1)))


def _between(start: np.ndarray, end: np.ndarray, radius: float, part: str, kind: str) -> dict[str, Any]:
    """A shape of revolution from one point to another; empty if they are the same."""
    if np.linalg.norm(end - start) < 1e-6:
        return {}
    points = {"from": rounded(np.asarray(start), _DIGITS), "to": rounded(np.asarray(end), _DIGITS)}
    return {"kind": kind, "part": part, "radius": radius, **points}


def _frame(X: RigidTransform) -> list[float | None]:
    return rounded(X.GetAsMatrix4().reshape(-1), _DIGITS)

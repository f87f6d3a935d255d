"""Rendered cells: the robot is where its silhouette says, the person where the cameras project it."""

from itertools import product
from pathlib import Path

import cv2
import numpy as np
import pytest

from systems.cell.overview.person import COLORS
from systems.cell.overview.rendering import CellPictures
from systems.vision.people.silhouettes import silhouettes
from tests.systems.vision.people.rigs import CAMERAS, SIZE, SURROUNDINGS, detector, person_at

SOME = CAMERAS.subset([1, 6])
ARM = [detector().arm.at(np.array([turn, 0.5, -0.3, 0.4, 0.8, 0.0])) for turn in (-1.2, 0.6)]
PERSON = person_at(0.9, 1.2)
PICTURES = CellPictures(SOME, SIZE, SURROUNDINGS, ARM[0], [PERSON], COLORS)
EMPTY = PICTURES.take(ARM[0], [None])


def differs(image: np.ndarray) -> np.ndarray:
    return np.abs(image.astype(int) - EMPTY.astype(int)).max(axis=-1) > 18


def test_only_pixels_of_the_silhouettes_change_when_the_robot_moves():
    moved = differs(PICTURES.take(ARM[1], [None]))
    drawn = [silhouettes(SOME, arm, SIZE, 0.04) > 0 for arm in ARM]
    bare = [silhouettes(SOME, arm, SIZE) > 0 for arm in ARM]
    assert moved.any(axis=(1, 2)).all()
    assert not (moved & ~drawn[0] & ~drawn[1]).any()
    one = bare[0] ^ bare[1]  # where only one of the two is, the half-covered pixels of its edge included
    assert (moved & one).sum() > 0.85 * one.sum()


def test_a_person_covers_the_pixels_to_which_the_cameras_project_it():
    """Lenses included: they shift pixels at the rim of these images by up to four."""
    shown, drawn = differs(PICTURES.take(ARM[0], [PERSON])), silhouettes(SOME, PERSON, SIZE) > 0
    robot = silhouettes(SOME, ARM[0], SIZE, 0.04) > 0
    both, either = (shown & drawn & ~robot).sum(), ((shown | drawn) & ~robot).sum()
    assert both > 0.85 * either


def test_a_mesh_is_drawn_where_the_figure_stands_and_looks(tmp_path: Path):
    """A board of 0.1 x 0.6 x 1.7 m, which covers other pixels if it is turned otherwise."""
    corners = np.array(list(product((-0.05, 0.05), (-0.3, 0.3), (0.0, 1.7))))
    normals = ((-1, 0, 0), (1, 0, 0), (0, 0, -1), (0, 0, 1), (0, -1, 0), (0, 1, 0))
    faces = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 7, 3), (2, 4, 8, 6), (1, 2, 6, 5), (3, 7, 8, 4))
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"vn {x} {y} {z}" for x, y, z in normals]
    lines += [f"f {' '.join(f'{corner}//{n}' for corner in face)}" for n, face in enumerate(faces, 1)]
    mesh = tmp_path / "board.obj"
    mesh.write_text("\n".join(lines) + "\n")
    pictures = CellPictures(SOME, SIZE, SURROUNDINGS, ARM[0], [PERSON], COLORS, [str(mesh)])
    shown = differs(pictures.take(ARM[0], [PERSON]))
    c, s = np.cos(0.3), np.sin(0.3)  # the direction of `person_at`
    placed = corners @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + [0.9, 1.2, SURROUNDINGS.floor]
    drawn = np.zeros_like(shown, np.uint8)
    for image, pixels in zip(drawn, SOME.project(placed), strict=True):
        cv2.fillConvexPoly(image, cv2.convexHull(np.rint(pixels).astype(np.int32)), 1)
    robot = silhouettes(SOME, ARM[0], SIZE, 0.04) > 0
    both, either = ((shown & (drawn > 0) & ~robot).sum(), ((shown | (drawn > 0)) & ~robot).sum())
    assert both > 0.8 * either
    with pytest.raises(ValueError, match=r"person: no mesh none\.obj"):
        CellPictures(SOME, SIZE, SURROUNDINGS, ARM[0], [PERSON], COLORS, ["none.obj"])

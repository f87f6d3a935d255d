"""Beside a path: distances at a right angle, whatever the timing is."""

import numpy as np
import pytest

from systems.reference.path_frame import PathLine
from systems.reference.paths import ReferenceConfig, make_path
from systems.reference.shapes import FigureEight, Points
from systems.reference.shapes.points import Waypoint

SQUARE = make_path(ReferenceConfig())


def test_a_point_of_the_path_lies_nowhere_beside_it():
    """A straight path is exact and a curve nearly; at a corner the direction is that of the next half mm."""
    for path, off in ((SQUARE, 1e-9), (make_path(ReferenceConfig(path=FigureEight())), 2e-6)):
        line, index, found = PathLine(path), 0, []
        for time in np.linspace(path.path_start, path.dwell_start, 400):
            place = line.place(path.sample(time)[0][:3, 3], index)
            index = place.index
            found.append(np.linalg.norm(place.p_error_W))
        assert np.median(found) < off
        assert max(found) < 2.6e-4
        assert place.along == pytest.approx(line.length, abs=1e-3)


def test_a_shift_across_is_the_error_and_one_along_is_none():
    line = PathLine(SQUARE)
    index = len(line.along) // 8
    x, y, z = line.R_WP[index].T
    place = line.place(line.points[index] + 2e-3 * y - 1e-3 * z + 1e-4 * x, index)
    np.testing.assert_allclose(place.p_error_W, -2e-3 * y + 1e-3 * z, atol=1e-9)


def test_the_frame_is_right_handed_and_x_is_the_direction_of_motion():
    line = PathLine(SQUARE)
    np.testing.assert_allclose(np.linalg.det(line.R_WP), 1.0)
    assert np.abs(line.R_WP.swapaxes(1, 2) @ line.R_WP - np.eye(3)).max() < 1e-12
    step = line.points[11] - line.points[10]
    np.testing.assert_allclose(line.R_WP[10, :, 0], step / np.linalg.norm(step), atol=1e-9)


def test_a_path_without_length_is_refused():
    turn = Points(waypoints=[Waypoint(zyx_deg=np.array([angle, 0.0, 0.0])) for angle in (0.0, 20.0)])
    with pytest.raises(ValueError, match="no length"):
        PathLine(make_path(ReferenceConfig(path=turn)))

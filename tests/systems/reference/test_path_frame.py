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


def test_all_laps_are_counted_and_one_is_kept():
    path = make_path(ReferenceConfig(laps=3))
    line, one, index = PathLine(path), PathLine(SQUARE), 0
    np.testing.assert_allclose(line.points, one.points, atol=1e-9)
    assert line.length == pytest.approx(3.0 * one.length)
    went = []
    for time in np.arange(path.path_start, path.dwell_start + 0.02, 0.02):
        tip = path.sample(time)[0][:3, 3]
        place = line.place(tip, index)
        index = place.index
        went.append(place.along)
        assert np.linalg.norm(place.p_error_W) < 2.6e-4
        assert line.way_to(index) == place.along
    assert np.diff(went).min() > -1e-3
    assert went[-1] == pytest.approx(line.length, abs=1e-3)
    # Behind the last lap there is nothing: the frame stays that of the last edge.
    np.testing.assert_array_equal(place.R_WP, line.R_WP[-1])
    assert len(PathLine(make_path(ReferenceConfig(laps=10000))).points) == len(one.points)


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


def test_a_shifted_robot_is_past_a_corner_when_its_shift_has_turned():
    """What it was sent tells the edge before the corner from that behind it, where places alone do not."""
    line, shift_P = PathLine(SQUARE), np.array([0.0, -8e-3, 12e-3])

    def shifts(R_WP: np.ndarray) -> np.ndarray:
        return R_WP @ shift_P

    corner = int(np.flatnonzero(np.abs(np.diff(line.R_WP[:, :, 0], axis=0)).max(axis=1) > 0.1)[0]) + 1
    for index in (corner - 1, corner):
        tip = line.points[index] + line.R_WP[index] @ shift_P
        assert line.shifted(tip, corner - 4, shifts).index == index
    # It never goes back, and after a gap in the reports it does not leave the way out.
    assert line.shifted(line.points[0], corner, shifts).index >= corner
    assert line.along[line.shifted(line.points[-1], corner, shifts).index] < line.along[corner] + 0.01


def test_the_frame_goes_on_where_the_tool_moves_along_its_own_axis():
    """The last edge of the rectangle ends so: its frame may turn with the tool, but not at once."""
    line = PathLine(SQUARE)
    same_edge = (line.R_WP[1:, :, 0] * line.R_WP[:-1, :, 0]).sum(axis=1) > 0.999
    turned = (line.R_WP[1:, :, 1] * line.R_WP[:-1, :, 1]).sum(axis=1)
    assert turned[same_edge].min() > 0.99


def test_a_path_without_length_is_refused():
    turn = Points(waypoints=[Waypoint(zyx_deg=np.array([angle, 0.0, 0.0])) for angle in (0.0, 20.0)])
    with pytest.raises(ValueError, match="no length"):
        PathLine(make_path(ReferenceConfig(path=turn)))

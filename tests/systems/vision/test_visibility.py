"""What cameras can see: a line of sight against capsules, a pixel against its window."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from robots.kinematics.arm_capsules import Capsules
from systems.vision.visibility import in_window, occluded

CAMERA, MARKER = np.array([[0.0, 0.0, 0.0]]), np.array([[4.0, 0.0, 0.0]])


def capsule(start, end, radius: float) -> Capsules:
    return Capsules(np.array([start], float), np.array([end], float), np.array([radius]))


def hidden_by(start, end, radius: float) -> bool:
    return bool(occluded(CAMERA, MARKER, capsule(start, end, radius))[0, 0])


def test_a_capsule_across_the_line_of_sight_hides_within_its_radius():
    assert hidden_by([2, -1, 0.099], [2, 1, 0.099], 0.1)
    assert not hidden_by([2, -1, 0.101], [2, 1, 0.101], 0.1)


def test_a_capsule_ends_in_a_half_sphere():
    assert hidden_by([2, 0.099, 0], [2, 1, 0], 0.1)
    assert not hidden_by([2, 0.101, 0], [2, 1, 0], 0.1)


def test_what_is_behind_the_camera_or_the_marker_hides_nothing():
    assert not hidden_by([-1, -1, 0], [-1, 1, 0], 0.1)
    assert not hidden_by([5, -1, 0], [5, 1, 0], 0.1)


def test_capsules_along_the_line_of_sight_or_without_length_hide():
    assert hidden_by([1, 0.05, 0], [3, 0.05, 0], 0.1)
    assert hidden_by([2, 0.05, 0], [2, 0.05, 0], 0.1)
    assert not hidden_by([1, 0.15, 0], [3, 0.15, 0], 0.1)


coordinates = st.floats(-1.0, 1.0, width=32)
points = st.tuples(coordinates, coordinates, coordinates).map(np.array)


@pytest.mark.slow
@given(points, points, points, points)
def test_a_capsule_hides_exactly_if_its_axis_comes_nearer_than_its_radius(a, b, c, d):
    """The distance of two segments is the minimum of a convex function on the unit square."""

    def gap2(s):
        return np.sum((a + s[0] * (b - a) - c - s[1] * (d - c)) ** 2)

    starts = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0), (0.5, 0.5)]
    best = min(minimize(gap2, start, bounds=[(0, 1)] * 2, tol=1e-14).fun for start in starts)
    distance = np.sqrt(best)
    wider, narrower = capsule(c, d, distance + 1e-3), capsule(c, d, distance - 1e-3)
    assert occluded(a[None], b[None], wider).all()
    if distance > 1e-3:
        assert not occluded(a[None], b[None], narrower).any()


def test_any_of_several_capsules_hides_and_none_hides_nothing():
    two = Capsules(np.array([[2.0, 3, 0], [2, -1, 0]]), np.array([[2.0, 4, 0], [2, 1, 0]]), np.full(2, 0.1))
    markers = np.array([[4.0, 0, 0], [4, 7, 0], [0, 4, 0]])
    np.testing.assert_array_equal(occluded(CAMERA, markers, two), [[True, True, False]])
    nothing = Capsules(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    assert not occluded(CAMERA, markers, nothing).any()


@pytest.mark.parametrize(
    ("pixel", "inside"),
    [((10, 20), True), ((100, 200), True), ((9.9, 50), False), ((50, 200.1), False), ((np.nan, 50), False)],
)
def test_a_window_has_its_corners(pixel: tuple, inside: bool):
    seen = in_window(np.array([[pixel]], float), np.array([[10.0, 20, 100, 200]]))
    assert seen[0, 0] == inside

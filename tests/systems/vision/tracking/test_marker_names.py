"""Naming markers by the geometry of their body: right or not at all."""

from itertools import product

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from systems.vision.marker_body import DetectionBody
from systems.vision.tracking.marker_names import MarkerNames
from tests.systems.vision.rigs import BODY, placed, random_pose

NAMES = MarkerNames(BODY, tolerance=1e-3)


def scene(seed: int, seen: list[int], false: int, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Some markers of the body and false points about it, in any order; the marker of each, -1 for false."""
    rng = np.random.default_rng(seed)
    X = random_pose(rng)
    points = placed(X, BODY.p_E[seen]) + sigma * rng.standard_normal((len(seen), 3))
    points = np.vstack([points, placed(X, rng.uniform(-0.2, 0.2, (false, 3)))])
    truth = np.array([*seen, *[-1] * false])
    order = rng.permutation(len(points))
    return points[order], truth[order]


seeds = st.integers(0, 2**32 - 1)
subsets = st.sets(st.integers(0, len(BODY) - 1), min_size=4).map(sorted)


@settings(max_examples=150, deadline=None)
@given(seeds, subsets, st.integers(0, 4))
def test_any_four_markers_are_named_rightly_among_false_points(seed: int, seen: list[int], false: int):
    points, truth = scene(seed, seen, false, sigma=5e-5)
    names = NAMES.name(points)
    assert names is not None
    assert {marker: point for marker, point in enumerate(names) if point >= 0} == {
        marker: point for point, marker in enumerate(truth) if marker >= 0
    }


@settings(max_examples=100, deadline=None)
@given(seeds, st.integers(0, 24))
def test_false_points_alone_are_not_the_body(seed: int, false: int):
    assert NAMES.name(scene(seed, [], false, 0.0)[0]) is None


def test_three_markers_are_too_few():
    assert NAMES.name(scene(0, [0, 1, 2], 0, 0.0)[0]) is None


def test_a_mirror_image_is_not_the_body():
    assert NAMES.name(BODY.p_E * [1.0, 1.0, -1.0]) is None


def test_a_body_that_looks_like_itself_turned_is_refused_not_guessed():
    cube = DetectionBody("cube", markers_mm=100.0 * np.array(list(product([0, 1], [0, 1], [0, 1]))))
    assert MarkerNames(cube, tolerance=1e-3).name(cube.p_E) is None

"""Searches without a gradient find the least of many minima, and a front on which nothing is better."""

import numpy as np
import pytest

from robots.identification.global_search import Box

pytest.importorskip("pymoo")

BEST = np.array([0.3, -0.5, 0.8])
BOX = Box(np.full(3, -2.0), np.full(3, 2.0), evaluations=1500, seed=1)


def many_minima(x: np.ndarray) -> float:
    """About one to each unit and unknown, all but one of them higher."""
    return float(np.sum(np.square(x - BEST) + 0.5 * (1.0 - np.cos(2.0 * np.pi * (x - BEST)))))


@pytest.mark.slow
@pytest.mark.parametrize("search", [BOX.cma, BOX.genetic])
def test_the_least_minimum_is_found_from_another_one(search):
    start = BEST + np.array([1.0, -1.0, 1.0])
    found = search(many_minima, start)
    assert many_minima(found) < 0.1 * many_minima(start)
    np.testing.assert_allclose(found, BEST, atol=0.1)


def test_on_the_front_less_of_one_cost_is_more_of_the_other():
    other = BEST + 0.2

    def costs(x: np.ndarray) -> np.ndarray:
        return np.array([np.sum(np.square(x - BEST)), np.sum(np.square(x - other))])

    front, points = BOX.front(costs, BEST)
    assert len(front) > 5
    assert (np.diff(front[:, 0]) > 0.0).all()
    assert (np.diff(front[:, 1]) < 0.0).all()
    np.testing.assert_allclose([costs(point) for point in points], front)
    # The front lies between the two best points: sqrt(a) + sqrt(b) is their distance there.
    distance = np.sqrt(front).sum(axis=1)
    assert distance.min() == pytest.approx(np.linalg.norm(other - BEST), rel=0.05)

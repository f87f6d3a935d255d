"""The smooth worst case: between the mean and the worst, and its slopes."""

import numpy as np
import pytest

from systems.feedforward.corrected_inverse.resting_places import WorstOf

ALIKE = np.ones(4)


def test_a_single_case_counts_as_it_is():
    worst = WorstOf.than(np.array([3.0]))
    assert worst.cost(np.array([2.0])) == pytest.approx(2.0)
    assert worst.slopes(np.array([2.0])) == pytest.approx([1.0])


def test_it_lies_between_the_mean_and_the_worst():
    squares = np.array([1.0, 2.0, 3.0, 6.0])
    assert squares.mean() < WorstOf.than(ALIKE).cost(squares) < squares.max()


def test_slopes_are_those_of_differences():
    worst = WorstOf.than(np.array([1.0, 4.0, 2.0]))
    squares, small = np.array([1.0, 2.0, 3.0]), 1e-6
    found = [(worst.cost(squares + d) - worst.cost(squares - d)) / (2.0 * small) for d in small * np.eye(3)]
    assert worst.slopes(squares) == pytest.approx(found, rel=1e-6)


def test_a_case_in_which_little_was_left_may_grow_the_least():
    slopes = WorstOf.than(np.array([1.0, 10.0])).slopes(np.array([2.0, 11.0]))
    assert slopes[0] > slopes[1]


def test_where_nothing_is_left_nothing_is_divided_by():
    worst = WorstOf.than(np.zeros(2))
    assert worst.cost(np.zeros(2)) == 0.0
    assert np.isfinite(worst.slopes(np.zeros(2))).all()

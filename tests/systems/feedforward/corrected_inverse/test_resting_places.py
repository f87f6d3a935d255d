"""Where a camera sees links rest; and the smooth worst case: between mean and worst, and its slopes."""

import numpy as np
import pytest

from systems.feedforward.corrected_inverse.resting_places import ANYWHERE, WorstOf, seen_places

ALIKE = np.ones(4)
HALF_GAPS = np.array([7e-5, 0.0, 0.0, 0.0, 0.0, 0.0])  # rad, half a minute of arc in axis 1
J = np.array([2.0, 0.0, 0.0])[:, None] * np.eye(6)[0]  # m, an arm as long as that of a KR 210


def seen_at(place: float, reach: float = 1.0):
    """Where axis 1 may rest if the tip is seen where it has it there."""
    return seen_places(reach * J @ (place * HALF_GAPS), reach * J, HALF_GAPS)


def test_a_link_rests_where_it_is_seen_however_wide_its_play_is():
    middle = next(each for each in seen_at(0.3) if each.play == 1.0)
    assert middle.place == pytest.approx((0.3, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert {each.play for each in seen_at(0.3)} == {0.88, 1.0, 1.12}
    for each in seen_at(0.3)[:3]:
        assert np.multiply(each.place, each.play)[0] == pytest.approx(0.3)


def test_and_a_standard_deviation_to_either_side():
    """0.03 mm of the 0.14 mm that half of the play moves the tip."""
    one, other = (np.asarray(each.place)[0] for each in seen_at(0.0)[3:])
    assert other == -one == pytest.approx(0.03 / 0.14, rel=0.1)


@pytest.mark.parametrize("place", [-1.3, -1.0, -0.85, 0.85, 1.0])
def test_near_an_end_it_rests_there_and_how_wide_the_play_is_is_all_that_is_open(place: float):
    found = seen_at(place)
    assert [each.place for each in found] == 3 * [(np.sign(place), 0.0, 0.0, 0.0, 0.0, 0.0)]
    assert sorted(each.play for each in found) == [0.88, 1.0, 1.12]


@pytest.mark.parametrize("axis", [0, 2])
def test_a_robot_that_is_not_calibrated_is_refused(axis: int):
    """Along what axis 1 moves, or across: a millimetre is no play."""
    with pytest.raises(ValueError, match=r"is (0\.9|1\.0) mm from where .* calibrated robot"):
        seen_places(1e-3 * np.eye(3)[axis], J, HALF_GAPS)


def test_of_a_tip_that_hardly_moves_with_it_a_camera_says_nothing():
    assert seen_at(1.0, reach=0.1) == ANYWHERE


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

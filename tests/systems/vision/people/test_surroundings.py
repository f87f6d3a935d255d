"""Furniture: what it hides, and files that describe none."""

import numpy as np
import pytest

from robots.description.placement import Placement
from systems.vision.people.surroundings import Furniture, behind, load_surroundings

BOX = Furniture("box", np.array([1.0, 2.0, 1.0]), Placement(np.array([5.0, 0.0, 0.0])))


def test_a_box_hides_what_is_behind_and_within_it_and_nothing_else():
    points = np.array([[8.0, 0, 0], [5.0, 0, 0], [4.0, 0, 0], [8.0, 0, 0.9], [8.0, 2.0, 0], [-8.0, 0, 0]])
    hidden = behind(BOX, np.zeros(3), points)
    # Over its edge 0.5 above, 4.5 m away: at 8 m the shadow ends 0.89 above.
    np.testing.assert_array_equal(hidden, [True, True, False, False, False, False])


def test_a_turned_box_hides_as_its_corners_say():
    turned = Furniture(
        "box", np.array([1.0, 2.0, 1.0]), Placement(np.array([5.0, 0, 0]), np.array([90.0, 0, 0]))
    )
    ray = np.array([[10.0, 1.5, 0.0]])  # passes 0.75 beside its middle
    assert behind(BOX, np.zeros(3), ray)
    assert not behind(turned, np.zeros(3), ray)


def test_shipped_surroundings_hold_a_pedestal_on_the_floor():
    found = load_surroundings("probst")
    pedestal = found.furniture[0]
    assert pedestal.corners[:, 2].min() == pytest.approx(found.floor)
    assert pedestal.corners[:, 2].max() == pytest.approx(0.0)  # where the robot stands


def test_a_volume_without_extent_is_refused_with_its_line(tmp_path):
    path = tmp_path / "cell.yaml"
    path.write_text("floor: 0\nlow: [1, 0, 0]\nhigh: [1, 2, 2]\n")
    with pytest.raises(ValueError, match=r"line 2: .*low must be below high"):
        load_surroundings(str(path))

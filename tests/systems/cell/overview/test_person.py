"""The walking figure: feet on the floor, limbs that keep their lengths, a way at its speed."""

import numpy as np
import pytest

from systems.cell.overview.person import COLORS, PersonConfig, WalkingPerson, WayPoint, figure

FLOOR = -0.5


def way(*points: tuple[float, float], rest: float = 0.0, **config) -> WalkingPerson:
    steps = [WayPoint(np.array(point), rest) for point in points]
    return WalkingPerson(PersonConfig(steps, **config), FLOOR)


def trunk_of(person: WalkingPerson, time: float) -> np.ndarray:
    capsules = person.at(time)
    assert capsules is not None
    return capsules.start[1]


def test_the_figure_is_as_tall_as_an_adult_and_stands_on_the_floor():
    person = figure(np.array([1.0, 2.0]), 0.7, FLOOR)
    ends = np.concatenate([person.start, person.end])
    radius = np.tile(person.radius, 2)
    assert (ends[:, 2] - radius).min() == pytest.approx(FLOOR)
    assert (ends[:, 2] + radius).max() - FLOOR == pytest.approx(1.75, abs=0.05)
    assert len(COLORS) == len(person.radius)


def test_limbs_keep_their_lengths_and_hang_together_while_it_walks():
    still = figure(np.zeros(2), 0.0, FLOOR)
    for phase in np.linspace(0.0, 6.0, 9):
        moving = figure(np.ones(2), 1.0, FLOOR, phase, 1.0)
        lengths = [np.linalg.norm(each.end - each.start, axis=1) for each in (still, moving)]
        np.testing.assert_allclose(*lengths, atol=1e-12)
        for thigh, shank in ((3, 4), (8, 9)):
            np.testing.assert_allclose(moving.end[thigh], moving.start[shank], atol=1e-12)


def test_it_walks_with_its_speed_rests_and_leaves():
    person = way((0.0, 0.0), (3.0, 0.0), rest=1.0, speed=1.5, start=2.0)
    assert person.at(1.9) is None
    trunk = [trunk_of(person, t) for t in (2.5, 3.0, 4.0, 5.0, 5.5)]
    np.testing.assert_allclose([p[0] for p in trunk], [0.0, 0.0, 1.5, 3.0, 3.0], atol=1e-9)
    assert person.end == pytest.approx(6.0)
    assert person.at(6.0) is None


def test_at_a_single_point_it_stays():
    assert trunk_of(way((1.0, 1.0)), 1e6)[:2] == pytest.approx([1.0, 1.0])


def test_a_way_without_points_is_refused():
    with pytest.raises(ValueError, match="at least one point"):
        way()

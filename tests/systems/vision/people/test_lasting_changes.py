"""What stays where it is has stood there since it was first seen; what moves or flickers has not."""

import numpy as np
import pytest

from systems.vision.people.background import Memory
from systems.vision.people.lasting_changes import LastingChange, Standing, lasting_changes, standing_still
from systems.vision.people.visual_hull import Body
from tests.systems.vision.people.rigs import ARMS, CONFIG, detector, painted, person_at

EDGE = 0.1
NOBODY: tuple[Standing, ...] = tuple[Standing, ...]()
UNCHANGED: tuple[LastingChange, ...] = tuple[LastingChange, ...]()


def box(x: float, size: int = 4) -> Body:
    """A cube of cubes; its lower corner at x."""
    points = np.stack(np.meshgrid(*[np.arange(size)] * 3, indexing="ij"), -1).reshape(-1, 3)
    return Body((points + 0.5) * EDGE + [x, 0.0, 0.0], size**3 * EDGE**3)


def standing(places: list[list[float]]) -> tuple[Standing, ...]:
    found = NOBODY
    for time, xs in enumerate(places):
        found = standing_still(found, float(time), [box(x) for x in xs], EDGE)
    return found


def test_a_body_that_stays_has_stood_since_it_came():
    (one, other) = standing([[], [1.0], [1.0, 3.0], [1.0, 3.0]])
    assert (one.since, other.since) == (1.0, 2.0)
    np.testing.assert_allclose(one.place, [1.2, 0.2, 0.2])
    np.testing.assert_allclose(one.size(EDGE), 0.4)


@pytest.mark.parametrize("places", [[[1.0], [1.3], [1.6]], [[1.0], [], [1.0]]])
def test_a_body_that_walks_or_comes_back_has_not(places: list[list[float]]):
    assert standing(places)[0].since == 2.0


def test_a_change_is_reported_once_when_it_has_stood_long_enough():
    images, known = np.zeros((1, 2, 2, 3), np.uint8), []
    found = UNCHANGED
    there = NOBODY
    for time in range(6):
        there = standing_still(there, float(time), [box(1.0)] if time else [], EDGE)
        found = lasting_changes(found, there, float(time), images, 2.5, EDGE)
        known.append(len(found))
    assert known == [0, 0, 0, 0, 1, 1]
    assert (found[0].known, found[0].standing.since) == (4.0, 1.0)


@pytest.mark.slow
def test_in_images_a_figure_that_stays_is_known_while_the_robot_moves():
    """The robot hides parts of it in turn; the hull keeps more than half of its cubes all the same."""
    rng, person = np.random.default_rng(2), person_at(1.4, 0.6)
    memory: Memory = detector().learn([painted(None, q, rng) for q in ARMS], ARMS)
    found = NOBODY
    for time in range(4):
        q = ARMS[time % len(ARMS)]
        seen, memory = detector().detect(memory, painted(person, q, rng), q)
        found = standing_still(found, float(time), seen.bodies, CONFIG.hull.edge)
    assert found[0].since == 0.0
    assert np.linalg.norm(found[0].place[:2] - [1.4, 0.6]) < 0.3

"""People in painted images of the cell: found, near where they are, and not mistaken for light or robot."""

import numpy as np
import pytest

from systems.cell.overview.person import gap
from systems.vision.people.background import Memory
from tests.systems.vision.people.rigs import ARMS, CAMERAS, SIZE, detector, painted, person_at

RNG = np.random.default_rng(5)
MEMORY = detector().learn([painted(None, q, RNG) for q in ARMS], ARMS)
ELSEWHERE = np.array([0.7, 0.2, 0.1, 0.3, 0.5, 0.0])  # where the robot was not while the cell was learnt


def seen(images: np.ndarray, memory: Memory = MEMORY, q: np.ndarray = ELSEWHERE):
    return detector().detect(memory, images, q)


@pytest.mark.parametrize("place", [(1.2, 0.4), (-1.5, 1.0), (0.3, -1.9), (2.2, 1.8)])
def test_the_distance_of_a_person_is_hardly_ever_too_large(place):
    person, arm = person_at(*place), detector().arm.at(ELSEWHERE)
    found, _ = seen(painted(person, ELSEWHERE, RNG))
    assert found.trusted
    measured = min(arm.distances(body.points).min() for body in found.bodies) - 0.5 * np.sqrt(3.0) * 0.08
    true = gap(person, arm)
    assert -0.5 < measured - true < 0.1  # behind the robot and between few cameras the hull is larger


@pytest.mark.parametrize("gain", [0.75, 0.95, 1.05, 1.3])
def test_light_that_changes_all_over_is_estimated_and_is_nobody(gain):
    found, _ = seen(painted(None, ELSEWHERE, RNG, gain))
    assert not found.bodies
    np.testing.assert_allclose([pixels.gain for pixels in found.pixels], gain, rtol=0.01)


@pytest.mark.slow
def test_who_stands_still_is_never_absorbed_while_slow_changes_are():
    memory, person = MEMORY, person_at(1.4, 0.6)
    images = painted(person, ELSEWHERE, RNG)
    images[:, :40] = np.clip(images[:, :40].astype(int) + 12, 0, 255)  # brighter, but less than the threshold
    first, memory = seen(images, memory)
    for _ in range(6 * len(CAMERAS)):
        last, memory = seen(images, memory)
    assert sum(body.volume for body in last.bodies) > 0.9 * sum(body.volume for body in first.bodies)
    before, after = (np.abs(m.mean[3][:30].astype(float) - images[3, :30]).mean() for m in (MEMORY, memory))
    assert after < 0.85 * before  # six turns of a camera, a twentieth each


def test_covered_lenses_are_not_trusted_and_too_many_of_them_tell_nothing():
    person = person_at(1.4, 0.6)
    images = painted(person, ELSEWHERE, RNG)
    images[:3] = 4
    found, _ = seen(images)
    assert [pixels.trusted for pixels in found.pixels] == [False] * 3 + [True] * (len(CAMERAS) - 3)
    assert found.trusted
    assert found.bodies
    images[:] = 4
    assert not seen(images)[0].trusted


def test_images_of_another_size_are_refused():
    width, height = SIZE
    with pytest.raises(ValueError, match=f"images must be 10 of {width} x {height} px in three colours, got"):
        seen(np.zeros((10, height, width + 1, 3), np.uint8))

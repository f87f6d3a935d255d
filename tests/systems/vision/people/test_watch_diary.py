"""The diary of a watch: the nearest of those who are there, and the images in which somebody was nearest."""

import numpy as np

from systems.samples import ImageSample, Person, PersonSample
from systems.vision.people.background import Memory
from systems.vision.people.lasting_changes import Standing
from systems.vision.people.people_follower import Mind
from systems.vision.people.visual_hull import Body
from systems.vision.people.watch_diary import WatchDiary
from tests.systems.vision.people.rigs import ARMS, detector

REACH = 0.04  # m


def mind(time: float, *places: tuple[float, float]) -> Mind:
    """Somebody of a single cube at each place, at the height of the shoulder of the robot."""
    points = [np.array([[x, y, 0.4]]) for x, y in places]
    people = tuple(Person(n, each, REACH, np.zeros(3)) for n, each in enumerate(points, 1))
    standing = tuple(Standing(time, Body(each, 0.1)) for each in points)
    sample = PersonSample(time, bool(places), people)
    return Mind(Memory((), np.zeros(0, bool)), sample=sample, standing=standing)


def test_the_nearest_person_counts_and_the_nearest_images_are_kept():
    arm = detector().arm
    diary, q = WatchDiary(arm), ARMS[1]
    told = [mind(0.0), mind(0.1, (2.0, 0.0), (0.0, 1.5)), mind(0.2, (1.2, 0.0)), mind(0.3, (2.0, 0.0))]
    for number, each in enumerate(told):
        diary.note(each, ImageSample(each.sample.time, np.full((1, 2, 2, 3), number, np.uint8)), q)
    seen = diary.seen()
    expected = [min(arm.at(q).distances(p.points)[0] for p in each.sample.people) for each in told[1:]]
    np.testing.assert_allclose(seen.distance, [np.nan, *(np.array(expected) - REACH)])
    np.testing.assert_allclose(seen.place[0], np.nan)
    np.testing.assert_allclose(seen.place[2], [1.2, 0.0])
    np.testing.assert_array_equal(seen.trusted, [False, True, True, True])
    assert seen.nearest is not None
    assert seen.nearest.time == 0.2
    assert (seen.nearest.images == 2).all()
    np.testing.assert_array_equal(seen.nearest.bodies[0].points, told[2].sample.people[0].points)

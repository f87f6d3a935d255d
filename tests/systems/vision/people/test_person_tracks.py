"""Tracks: numbers stay with people, and velocities are those of their bodies."""

import numpy as np

from systems.vision.people.person_tracks import TrackConfig, followed
from systems.vision.people.visual_hull import Body

CONFIG = TrackConfig(gate=0.6, smoothing=0.5)


def body(x: float, y: float) -> Body:
    return Body(np.array([[x, y, 0.0], [x, y, 1.0]]), 0.06)


def test_two_who_pass_each_other_keep_their_numbers_and_have_their_velocities():
    tracks, number = (), 1
    for step in range(41):
        t = 0.05 * step
        bodies = [body(-1.5 + 1.5 * t, 0.0), body(1.5 - 1.5 * t, 0.4)]
        tracks, people, number = followed(tracks, number, t, bodies[:: 1 if step % 2 else -1], 0.05, CONFIG)
    by_number = {person.number: person for person in people}
    assert sorted(by_number) == [1, 2]
    speeds = sorted(person.velocity[0] for person in people)
    np.testing.assert_allclose(speeds, [-1.5, 1.5], atol=1e-6)
    assert {np.sign(person.velocity[0]) for person in people if person.points[0, 0] > 0.0} == {1.0}


def test_who_leaves_is_forgotten_and_who_comes_is_new():
    tracks, people, number = followed((), 1, 0.0, [body(0.0, 0.0)], 0.05, CONFIG)
    tracks, people, number = followed(tracks, number, 0.05, [body(2.0, 0.0)], 0.05, CONFIG)
    assert [person.number for person in people] == [2]
    assert not people[0].velocity.any()
    assert followed(tracks, number, 0.1, [], 0.05, CONFIG)[0] == ()

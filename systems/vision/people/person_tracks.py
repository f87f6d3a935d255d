"""People from sample to sample: which body is which, and how fast it moves."""

from dataclasses import dataclass

import numpy as np

from robots.configuration.quantity import quantity
from systems.samples import Person
from systems.vision.people.visual_hull import Body


@dataclass
class TrackConfig:
    """How bodies are followed; read from a scenario file."""

    gate: float = quantity(0.6, 0.0, 10.0, "m", is_open=True)  # from where a person is expected
    smoothing: float = quantity(0.3, 0.0, 1.0, is_open=True)  # share of a new velocity


@dataclass(frozen=True)
class Track:
    """A person that is followed."""

    number: int
    time: float  # s
    place: np.ndarray  # of the middle of the body in m, (3,)
    velocity: np.ndarray  # m/s, (3,)


def followed(
    tracks: tuple[Track, ...],
    next_number: int,
    time: float,
    bodies: list[Body],
    edge: float,
    config: TrackConfig,
) -> tuple[tuple[Track, ...], tuple[Person, ...], int]:
    """The tracks after a sample.

    The nearest pair of expected person and body is joined first, then the next. A body that nobody is near is
    somebody new; a track without a body ends, for a person who is hidden from all cameras cannot be told from
    one who has gone, and the hull of those who are seen holds what is hidden behind the robot.

    Args:
        tracks: before.
        next_number: of the next new person.
        time: of the sample in s.
        bodies: in it.
        edge: of their cubes in m.
        config: how they are followed.

    Returns:
        The tracks, the people with their bodies in the same order, and the next free number.
    """
    middles = [body.points.mean(axis=0) for body in bodies]
    expected = [track.place + (time - track.time) * track.velocity for track in tracks]
    pairs = sorted(
        (float(np.linalg.norm(middle - place)), i, j)
        for i, middle in enumerate(middles)
        for j, place in enumerate(expected)
    )
    known: dict[int, Track] = {}
    for distance, i, j in pairs:
        if distance <= config.gate and i not in known and tracks[j] not in known.values():
            known[i] = tracks[j]
    found, people, reach = [], [], 0.5 * np.sqrt(3.0) * edge
    for i, (body, middle) in enumerate(zip(bodies, middles, strict=True)):
        before = known.get(i)
        if before is None:
            number, velocity, next_number = next_number, np.zeros(3), next_number + 1
        else:
            number, velocity = before.number, before.velocity
            if time > before.time:
                now = (middle - before.place) / (time - before.time)
                velocity = velocity + config.smoothing * (now - velocity)
        found.append(Track(number, time, middle, velocity))
        people.append(Person(number, body.points, float(reach), velocity))
    return tuple(found), tuple(people), next_number

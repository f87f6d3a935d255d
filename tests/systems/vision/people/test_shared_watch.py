"""What a control cycle and a process that looks for people leave for each other, and that neither waits."""

import numpy as np
import pytest

from systems.samples import Person, PersonSample
from systems.vision.people.shared_watch import SharedWatch


def somebody(number: int, count: int = 5, x: float = 1.0) -> Person:
    points = np.random.default_rng(number).uniform(0.0, 1.0, (count, 3)) + np.array([x, 0.0, 0.0])
    return Person(number, points, 0.04, np.array([0.1 * number, 0.2, 0.3]))


def test_who_is_published_is_read():
    shared = SharedWatch()
    assert not shared.people().trusted
    for sample in (
        PersonSample(1.0, True, (somebody(1), somebody(2, 7))),
        PersonSample(2.0, False, ()),
        PersonSample(3.0, True, (somebody(3, 900),)),
    ):
        shared.publish(sample, 0.01)
        read = shared.people()
        assert (read.time, read.trusted) == (sample.time, sample.trusted)
        for one, other in zip(read.people, sample.people, strict=True):
            assert (one.number, one.reach) == (other.number, other.reach)
            np.testing.assert_array_equal(one.points, other.points)
            np.testing.assert_array_equal(one.velocity, other.velocity)
    assert shared.sets == 3
    assert shared.seconds == pytest.approx(0.03)


def test_nobody_is_read_while_he_is_being_written(monkeypatch):
    """Between the two counts of a writer the reader has what was there before, at once."""
    shared = SharedWatch()
    shared.publish(PersonSample(1.0, True, (somebody(1),)), 0.0)
    before = shared.people()
    writer = SharedWatch.__new__(SharedWatch)
    writer.__setstate__(shared.__getstate__())  # the same memory in another process
    seen = []

    class Interrupted(tuple):
        """People of whom one more is asked for after some are written."""

        def __iter__(self):
            yield somebody(2, 5, x=5.0)
            seen.append(shared.people())
            yield somebody(3, 5, x=6.0)

    writer.publish(PersonSample(2.0, True, Interrupted((somebody(2), somebody(3)))), 0.0)
    assert seen == [before]
    assert shared.people().time == 2.0


def test_more_people_than_there_is_room_for_are_not_trusted_away():
    for people in (tuple(somebody(k) for k in range(100)), (somebody(1, 20_000),)):
        shared = SharedWatch()
        shared.publish(PersonSample(1.0, True, people), 0.0)
        assert not shared.people().trusted
        assert len(shared.people().people) > 0


def test_joints_are_those_nearest_to_an_exposure_or_none():
    shared = SharedWatch()
    assert shared.joints_at(0.0, 1.0) is None
    assert shared.newest_joints() is None
    for k in range(2000):  # longer than what is kept
        shared.note_joints(0.004 * k, np.full(6, float(k)))
    found = shared.joints_at(0.004 * 1900 + 0.001, 0.02)
    assert found is not None
    np.testing.assert_array_equal(found, np.full(6, 1900.0))
    assert shared.joints_at(0.004 * 100, 0.02) is None  # forgotten
    assert shared.joints_at(9.0, 0.02) is None  # not yet there
    newest = shared.newest_joints()
    assert newest is not None
    np.testing.assert_array_equal(newest[1], np.full(6, 1999.0))

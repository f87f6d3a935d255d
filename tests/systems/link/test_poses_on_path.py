"""A camera's samples on the clock of a path: each at one instant, and none of another time."""

from types import SimpleNamespace
from typing import Any

import pytest
from pydrake.math import RigidTransform

from systems.link.clock import StampClock
from systems.link.poses_on_path import PosesOnPath
from systems.samples import PoseSample

STAMPED_AHEAD = 1000.0  # s, by which the robot's clock is ahead of the steady one


def seen_at(*exposures: float) -> Any:
    """A camera that has a sample at each poll, of these steady times in s."""
    samples = iter(PoseSample(time, RigidTransform(), valid=True) for time in exposures)
    return SimpleNamespace(
        poll=lambda now: next(samples, None), report=lambda: SimpleNamespace(last_error="")
    )


def poses(camera: Any) -> PosesOnPath:
    """The samples of a camera, with a robot whose clock is known."""
    clock = StampClock()
    clock.observe(round(1e6 * STAMPED_AHEAD), 0.0)
    return PosesOnPath(camera, clock)


def test_a_sample_keeps_its_instant_whatever_the_stamps_of_later_reports_say():
    found = poses(seen_at(4.9))
    found.start_path(4.0)
    found.at(1.0, STAMPED_AHEAD + 5.0)
    found.poll(5.001)
    first = found.at(1.004, STAMPED_AHEAD + 5.004)
    assert first.time == pytest.approx(0.9, abs=1e-9)
    late = 3e-4  # s, of the stamp
    assert found.at(1.008, STAMPED_AHEAD + 5.008 + late) is first


def test_what_comes_next_is_known_until_the_camera_shows_something_new():
    found = poses(seen_at(4.9, 4.95))
    found.start_path(4.0)
    found.poll(5.001)
    assert found.coming is None  # the path's clock has not shown anything yet
    found.at(1.0, STAMPED_AHEAD + 5.002)
    expected = found.coming
    assert found.at(1.004, STAMPED_AHEAD + 5.006) is expected is not None
    found.poll(5.01)
    assert found.coming not in (None, expected)


def test_what_was_exposed_before_the_path_began_is_of_another_time():
    found = poses(seen_at(4.9))
    found.start_path(5.0)
    found.poll(5.001)
    assert not found.at(0.0, STAMPED_AHEAD + 5.002).valid


def test_nothing_is_seen_without_a_camera():
    found = poses(None)
    found.poll(1.0)
    assert not found.at(0.0, STAMPED_AHEAD).valid
    assert found.problem()


@pytest.mark.parametrize(
    ("counters", "why"),
    [
        ({"frames": 0}, "it sends no frames, as if it did not measure"),
        ({"frames": 0, "wrong_sender": 500}, "its frames come from another address than its own"),
        ({"frames": 500, "lost_body": 2, "impossible": 498}, "its frames have no rotation of the body"),
        ({"frames": 500, "lost_body": 500}, "it does not see the body"),
    ],
)
def test_a_camera_that_shows_nothing_says_what_is_the_matter_with_its_frames(counters: dict, why: str):
    report = SimpleNamespace(last_error="", counters=counters)
    camera: Any = SimpleNamespace(poll=lambda now: None, report=lambda: report)
    assert poses(camera).problem().startswith(why)

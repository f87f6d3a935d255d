"""The share of the speed for a controller that needs more than all of its performance."""

import pytest

from systems.guard.performance_share import PerformanceShare

TICK = 4e-3  # s


def test_the_share_falls_at_once_to_what_can_be_done_and_rises_again_within_seconds():
    share = PerformanceShare()
    assert share.after(0.9, 1.0, TICK) == 1.0
    assert share.after(2.0, 1.0, TICK) == 0.5
    # At half the rate all is needed: nothing more is to be given up.
    assert share.after(1.0, 0.5, TICK) == 0.5
    assert share.after(1.25, 0.5, TICK) == 0.4
    told = [share.after(0.5, 0.4, TICK) for _ in range(round(6.5 / TICK))]
    assert told == sorted(told)
    assert told[round(3.0 / TICK)] == pytest.approx(0.7, abs=0.051)
    assert told[-1] == 1.0


def test_it_never_stops_a_robot_that_could_then_not_say_that_it_can_go_on():
    share = PerformanceShare()
    assert share.after(1e6, 1.0, TICK) == 0.1
    assert share.after(1e6, 0.1, TICK) == 0.1

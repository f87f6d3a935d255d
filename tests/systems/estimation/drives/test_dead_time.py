"""A dead time that nobody knows, from a short motion of the joints."""

import numpy as np
import pytest

from systems.estimation.drives.dead_time import CommandDelay, DeadTime, DeadTimeConfig

PERIOD = 4e-3


def knock(time: float) -> np.ndarray:
    """A motion of 0.4 s with another size of each joint."""
    s = np.clip((time - 0.2) / 0.4, 0.0, 1.0)
    return 0.01 * np.arange(1, 7) * np.sin(np.pi * s) ** 2


def searched(delay: float, until: float, motion=knock, noise=0.0, offset=0.0, **settings):
    search, rng = DeadTime(PERIOD, DeadTimeConfig()), np.random.default_rng(0)
    memory = search.layout.view(np.zeros(search.layout.size))
    for k in range(round(until / PERIOD) + 1):
        time = k * PERIOD
        search.command(memory, time, motion(time))
        search.measure(memory, time, motion(time - delay) + offset + noise * rng.normal(size=6))
    return search, search.search(memory, **{"believed": 0.0, **settings})


@pytest.mark.parametrize("delay", [0.0, 0.0053, 0.04, 0.137, 0.3])
def test_a_dead_time_is_found_to_a_fraction_of_a_period(delay):
    search, found = searched(delay, 0.6 + delay, noise=1.2e-5, offset=0.01)
    assert search.found(found)
    assert found is not None
    assert found.delay == pytest.approx(delay, abs=0.3e-3)
    if delay > 0.03:
        assert found.residual_believed > 0.1


def test_at_constant_speed_the_place_tells_the_delay():
    def steady(time):
        return 0.2 * time * np.ones(6)

    search, found = searched(0.034, 1.0, motion=steady, noise=1.2e-5, is_working=True)
    assert search.found(found)
    assert found is not None
    assert found.delay == pytest.approx(0.034, abs=0.3e-3)


def test_joints_at_rest_show_nothing():
    assert searched(0.1, 1.0, motion=lambda time: np.zeros(6), noise=1.2e-5)[1] is None


def test_motors_that_do_something_else_are_no_dead_time():
    search = DeadTime(PERIOD, DeadTimeConfig())
    memory = search.layout.view(np.zeros(search.layout.size))
    for k in range(250):
        time = k * PERIOD
        search.command(memory, time, knock(time))
        search.measure(memory, time, 0.02 * np.sin(9.0 * time + np.arange(6)))
    assert not search.found(search.search(memory, 0.0))


def test_refuses_a_window_of_zero():
    with pytest.raises(ValueError, match="window and longest must be positive"):
        DeadTime(PERIOD, DeadTimeConfig(window=0.0))


def following(changes, duration: float):
    """Motors that follow at a dead time which changes at once; delays in use, and the motors' places."""
    delay = CommandDelay(PERIOD, DeadTimeConfig())
    memory = delay.layout.view(np.zeros(delay.layout.size))
    delay.start(memory, 0.004)
    memory.known[0] = 1.0
    sent, used, planned = [], [], 0.0
    for k in range(round(duration / PERIOD)):
        time = k * PERIOD
        planned = time + delay.step(memory, planned)
        used.append(memory.delay[0])
        sent.append(wander(planned))
        delay.search.command(memory.search, time, sent[-1])
        true = [late for begin, late in changes if begin <= time][-1]
        delay.search.measure(memory.search, time, sent[max(0, k - round(true / PERIOD))])
        delay.look(memory)
    return np.array(used)


def wander(time: float) -> np.ndarray:
    return 0.3 * np.sin(1.1 * time + np.arange(6))


@pytest.mark.parametrize("change", [0.032, -0.032])
def test_a_dead_time_that_changes_is_followed_once_and_smoothly(change: float):
    begin = 0.008 if change > 0.0 else 0.048
    used = following([(0.0, begin), (1.0, begin + change)], 3.0)
    assert used[200] == pytest.approx(begin, abs=1.5 * PERIOD)
    settled = used[round(1.4 / PERIOD) :]
    # Commands of before and of after its correction tell the same: nothing runs away.
    np.testing.assert_allclose(settled, begin + change, atol=0.5e-3)
    rates = np.diff(used) / PERIOD
    assert np.abs(rates).max() <= 0.5 + 1e-9
    assert np.abs(np.diff(rates)).max() <= 10.0 * PERIOD + 1e-9

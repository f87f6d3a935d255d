"""A dead time that nobody knows, from a short motion of the joints."""

import numpy as np
import pytest

from systems.estimation.dead_time import DeadTime, DeadTimeConfig

PERIOD = 4e-3


def knock(time: float) -> np.ndarray:
    """A motion of 0.4 s with another size of each joint."""
    s = np.clip((time - 0.2) / 0.4, 0.0, 1.0)
    return 0.01 * np.arange(1, 7) * np.sin(np.pi * s) ** 2


def searched(lag: float, until: float, motion=knock, noise: float = 0.0, offset: float = 0.0):
    search, rng = DeadTime(PERIOD, DeadTimeConfig()), np.random.default_rng(0)
    memory = search.layout.view(np.zeros(search.layout.size))
    for k in range(round(until / PERIOD) + 1):
        time = k * PERIOD
        search.plan(memory, time + 0.004, motion(time + 0.004))
        search.measure(memory, time, motion(time - lag) + offset + noise * rng.normal(size=6))
    return search, search.search(memory)


@pytest.mark.parametrize("lag", [-0.003, 0.0, 0.0013, 0.04, 0.137, 0.3])
def test_a_dead_time_is_found_to_a_fraction_of_a_period(lag):
    search, found = searched(lag, 0.6 + max(lag, 0.0), noise=1.2e-5, offset=0.01)
    assert search.found(found)
    assert found is not None
    assert found.lag == pytest.approx(lag, abs=0.3e-3)
    if lag > 0.03:
        assert found.residual_at_zero > 0.1


def test_joints_at_rest_show_nothing():
    assert searched(0.1, 1.0, motion=lambda time: np.zeros(6), noise=1.2e-5)[1] is None


def test_motors_that_do_something_else_are_no_dead_time():
    search = DeadTime(PERIOD, DeadTimeConfig())
    memory = search.layout.view(np.zeros(search.layout.size))
    for k in range(250):
        time = k * PERIOD
        search.plan(memory, time + 0.004, knock(time + 0.004))
        search.measure(memory, time, 0.02 * np.sin(9.0 * time + np.arange(6)))
    assert not search.found(search.search(memory))


def test_refuses_a_window_of_zero():
    with pytest.raises(ValueError, match="window and longest must be positive"):
        DeadTime(PERIOD, DeadTimeConfig(window=0.0))

"""Watching a run does not change it; what is seen is where things are; speed and pause are obeyed."""

import threading
import time

import numpy as np
import pytest

from diagrams.runs.simulation import Experiment, run
from diagrams.scenario.scenario import load_scenario
from experiments.replay.live import (
    DEFLECTION,
    DEVIATION,
    ERROR,
    PAUSE,
    SPEED,
    TIME,
    LiveView,
    advance_live,
    between,
)
from robots.description.model import load_robot
from tests.experiments.test_compare import SETTINGS, same

pytestmark = pytest.mark.real_time


def opened(speed: float | None = None) -> tuple[Experiment, LiveView]:
    scenario, robot = load_scenario("misaligned", SETTINGS), load_robot("irb1200")
    experiment = Experiment(scenario, "numerical_ik", robot)
    return experiment, LiveView(experiment, robot, port=0, speed=speed)


@pytest.mark.slow
def test_a_run_that_is_watched_is_the_same_bit_for_bit():
    experiment, view = opened()
    shares, frames, show = [], [], view.show

    def counted() -> None:
        show()
        frames.append(experiment.context.get_time())

    view.show = counted
    view.meshcat.SetSliderValue(DEVIATION, 300.0)
    view.meshcat.SetSliderValue(DEFLECTION, 30.0)
    advance_live(experiment, view, shares.append)
    alone = run(experiment.scenario, "numerical_ik", load_robot("irb1200"))
    watched = experiment.log()
    assert np.array_equal(watched.time, alone.time)
    assert same(watched, alone)
    assert view.address.startswith("http://localhost:")
    # 30 frames per second of the 1.8 s, as evenly as ticks of 4 ms let them be.
    np.testing.assert_allclose(np.diff(frames)[:-1], 0.032, atol=1e-9)
    assert (frames[0], frames[-1], shares[-1]) == (0.0, pytest.approx(1.8), 1.0)
    # The error that is read is that of the log.
    error = np.linalg.norm(watched.X_WE_true[-1, :3, 3] - watched.X_WE_desired[-1, :3, 3])
    assert view.meshcat.GetSliderValue(ERROR) == pytest.approx(1e3 * error, abs=1e-3)
    assert view.meshcat.GetSliderValue(TIME) == pytest.approx(1.8, abs=0.01)


def test_the_speed_that_is_chosen_is_not_exceeded():
    experiment, view = opened(speed=1.0)
    started = time.monotonic()
    experiment.advance(until=0.2, show=view.show)
    assert time.monotonic() - started > 0.2 - 0.02
    view.meshcat.SetSliderValue(SPEED, 0.5)
    view.show()
    started = time.monotonic()
    experiment.advance(until=0.4, show=view.show)
    assert time.monotonic() - started > 0.4 - 0.04


def test_a_pause_stands_still_and_goes_on(monkeypatch):
    experiment, view = opened()
    clicks = {"now": 1}
    monkeypatch.setattr(
        type(view.meshcat), "GetButtonClicks", lambda _, name: clicks["now"] * (name == PAUSE)
    )
    released = threading.Timer(0.2, clicks.update, kwargs={"now": 2})
    released.start()
    started = time.monotonic()
    view.show()
    assert time.monotonic() - started > 0.15
    view.show()
    assert experiment.context.get_time() == 0.0


def test_nobody_is_waited_for_longer_than_asked():
    _, view = opened()
    started = time.monotonic()
    assert not view.wait_for_browser(0.1)
    assert 0.1 <= time.monotonic() - started < 1.0


@pytest.mark.parametrize("way", [[0.3, 0.0, 0.0], [0.0, 0.0, -0.2], [0.1, -0.2, 0.05], [0.0, 0.0, 0.0]])
def test_an_arrow_goes_from_one_point_to_the_other(way: list[float]):
    start = np.array([0.4, -0.1, 0.6])
    X = between(start, start + way)
    ends = X @ np.array([[0.0, 0.0, -0.5, 1.0], [0.0, 0.0, 0.5, 1.0]]).T
    np.testing.assert_allclose(ends[:3, 0], start, atol=1e-6)
    np.testing.assert_allclose(ends[:3, 1], start + way, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(X[:3, :2], axis=0), 1.0)

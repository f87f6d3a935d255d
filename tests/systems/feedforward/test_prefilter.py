"""Prefilters: the filters that their names promise, with derivatives and a known delay."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import bessel, lsim

from robots.description.model import load_robot
from systems.controller_model import ControllerModel
from systems.feedforward import FEEDFORWARDS, FeedforwardConfig
from systems.feedforward.prefilter import KINDS, Prefilter, PrefilterConfig

PERIOD, CUTOFF = 4e-3, 20.0
TIMES = np.arange(0.0, 0.6, PERIOD)
RAMP = np.clip((TIMES - 0.1) / 0.05, 0.0, 1.0)


def filtered(config: PrefilterConfig, signal: np.ndarray) -> np.ndarray:
    """The signal and its derivatives at every tick, (n, order)."""
    model = Prefilter(config, PERIOD)
    states = [model.at_rest(signal[:1])]
    for before, now in pairwise(signal):
        states.append(model.step(states[-1], np.array([before]), np.array([now])))
    return np.array(states)[:, :, 0]


@pytest.mark.parametrize("order", [1, 2, 4, 8])
def test_a_bessel_filter_is_that_of_scipy_also_between_jumps_of_the_slope(order: int):
    expected = lsim(bessel(order, 2.0 * np.pi * CUTOFF, analog=True, norm="mag"), RAMP, TIMES)[1]
    found = filtered(PrefilterConfig("bessel", order, CUTOFF), RAMP)[:, 0]
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_a_critically_damped_filter_is_a_chain_of_lags_and_gives_their_derivatives():
    """(3.32) and (3.33), integrated by something else."""
    w = 2.0 * np.pi * CUTOFF

    def lags(time: float, x: np.ndarray) -> np.ndarray:
        return w * (np.concatenate([[np.interp(time, TIMES, RAMP)], x[:-1]]) - x)

    x = solve_ivp(lags, (0.0, 0.3), np.zeros(3), "LSODA", max_step=1e-3, rtol=1e-10, atol=1e-12).y[:, -1]
    y = filtered(PrefilterConfig("critically_damped", 3, CUTOFF), RAMP)[round(0.3 / PERIOD)]
    expected = [x[2], w * (x[1] - x[2]), w * w * (x[0] - 2.0 * x[1] + x[2])]
    np.testing.assert_allclose(y, expected, atol=1e-7, rtol=1e-6)


@pytest.mark.parametrize("kind", KINDS[1:])
@pytest.mark.parametrize("order", [2, 4, 6])
def test_a_slow_signal_comes_through_late_by_the_delay_and_with_its_derivatives(kind: str, order: int):
    config = PrefilterConfig(kind, order, CUTOFF)
    delay = Prefilter(config, PERIOD).delay
    state = filtered(config, 2.0 * TIMES)[-1]
    assert state[0] == pytest.approx(2.0 * (TIMES[-1] - delay), abs=1e-9)
    assert state[1] == pytest.approx(2.0, abs=1e-7)


@pytest.mark.parametrize(("kind", "overshoot"), [("critically_damped", 1e-12), ("bessel", 0.01)])
def test_a_step_hardly_overshoots(kind: str, overshoot: float):
    step = (TIMES > 0.1).astype(float)
    assert filtered(PrefilterConfig(kind, 4, CUTOFF), step)[:, 0].max() <= 1.0 + overshoot


def test_the_highest_derivative_is_what_drives_the_chain():
    model = Prefilter(PrefilterConfig("bessel", 3, CUTOFF), PERIOD)
    state, step = np.array([[0.1], [2.0], [30.0]]), 1e-6
    fine = Prefilter(PrefilterConfig("bessel", 3, CUTOFF), step)
    moved = fine.step(state, np.array([0.5]), np.array([0.5]))
    # The third derivative changes by its own size in a filter's time, thousands of ticks of a microsecond.
    expected = (moved[2] - state[2]) / step
    np.testing.assert_allclose(model.highest_derivative(state, np.array([0.5])), expected, rtol=2e-3)


@pytest.mark.parametrize(("kind", "needed"), [("rigid", 2), ("flexible_joint", 3), ("elastic_structure", 4)])
def test_an_order_too_low_for_the_inverse_is_refused_with_the_reason(kind: str, needed: int):
    robot = load_robot("irb1200")
    for order, refused in ((needed - 1, True), (needed, False)):
        config = FeedforwardConfig(kind, prefilter=PrefilterConfig("bessel", order))
        if not refused:
            assert FEEDFORWARDS[kind](ControllerModel(robot), config).delay > 0.0
            continue
        message = f"order must be at least {needed}, got {order}: feedforward {kind} takes derivatives"
        with pytest.raises(ValueError, match=message):
            FEEDFORWARDS[kind](ControllerModel(robot), config)


@pytest.mark.parametrize(
    ("config", "message"),
    [
        (PrefilterConfig("butterworth"), "kind must be one of none, critically_damped, bessel"),
        (PrefilterConfig("bessel", cutoff_hz=0.0), "cutoff_hz must be positive, got 0.0 Hz"),
        (PrefilterConfig("bessel", order=0), "order must be at least 1, got 0"),
    ],
)
def test_an_impossible_filter_is_refused(config: PrefilterConfig, message: str):
    with pytest.raises(ValueError, match=message):
        Prefilter(config, PERIOD)

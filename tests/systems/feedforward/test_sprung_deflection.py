"""Springs and dampers under load: exact where linear, right where they stiffen, bounded always."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from robots.drivetrain.stiffness import CubicSpring
from systems.feedforward.sprung_deflection import SprungDeflection

SPRING = CubicSpring(1e4, 3e4)
DAMPING = np.array([20.0])  # a pole at -500 / s and beyond


def load(time: float) -> np.ndarray:
    return 80.0 * np.sin(2.0 * np.pi * 3.0 * np.atleast_1d(time))


def stepped(model: SprungDeflection, period: float, end: float) -> np.ndarray:
    x = model.at_rest(load(0.0))
    for before, now in pairwise(np.arange(0.0, end + 0.5 * period, period)):
        x = model.step(x, load(before), load(now))
    return x


@given(st.floats(1e2, 1e7), st.floats(0.0, 1e5), st.floats(1e-4, 0.1), st.tuples(*[st.floats(-1e3, 1e3)] * 3))
def test_under_a_load_that_grows_evenly_a_tick_is_exact(
    stiffness: float, damping: float, period: float, start: tuple[float, float, float]
):
    """Two half ticks are one tick, and the differential equation holds at the end."""
    deflection, first, last = start[0] / stiffness, start[1], start[2]
    K, D = np.array([stiffness]), np.array([damping])
    whole, half = (SprungDeflection(K, D, T) for T in (period, 0.5 * period))
    middle = 0.5 * (first + last)
    x = np.array([deflection])
    once = whole.step(x, np.array([first]), np.array([last]))
    twice = half.step(
        half.step(x, np.array([first]), np.array([middle])), np.array([middle]), np.array([last])
    )
    np.testing.assert_allclose(once, twice, rtol=1e-9, atol=1e-9 * 1e3 / stiffness)


@pytest.mark.parametrize("spring", [None, SPRING], ids=["linear", "cubic"])
def test_deflections_obey_their_differential_equation(spring: CubicSpring | None):
    """The error is of the second order in the tick: a load is not linear, a spring's tangent not constant."""

    def rate(time: float, x: np.ndarray) -> np.ndarray:
        torque = 1e4 * x if spring is None else spring.torque(x)
        return -(torque + load(time)) / DAMPING

    end = 0.15
    start = SprungDeflection(np.array([1e4]), DAMPING, 1e-3, spring).at_rest(load(0.0))
    exact = solve_ivp(rate, (0.0, end), start, "Radau", rtol=1e-11, atol=1e-14).y[:, -1]
    coarse, fine = (
        stepped(SprungDeflection(np.array([1e4]), DAMPING, T, spring), T, end) - exact for T in (2e-3, 1e-3)
    )
    assert abs(fine[0]) < 2e-4 * abs(exact[0])
    assert abs(fine[0]) < 0.3 * abs(coarse[0])


def test_without_damping_the_deflection_is_that_of_rest():
    for spring in (None, SPRING):
        model = SprungDeflection(np.array([1e4, 1e4]), np.zeros(2), 4e-3, spring)
        now = np.array([50.0, -700.0])
        found = model.step(np.zeros(2), np.zeros(2), now)
        np.testing.assert_allclose(found, model.at_rest(now), rtol=1e-9)


@given(st.lists(st.floats(-1e4, 1e4), min_size=2, max_size=8), st.floats(0.0, 1e3))
def test_deflections_are_bounded_whatever_the_load_does(loads: list[float], damping: float):
    model = SprungDeflection(np.array([1e4]), np.array([damping]), 4e-3, SPRING)
    x = np.zeros(1)
    largest = float(np.abs(model.at_rest(np.array([max(map(abs, loads))])))[0])
    for before, now in pairwise([0.0, *loads]):
        x = model.step(x, np.array([before]), np.array([now]))
        # A cubic spring is at most as stiff in its tangent as three times in its secant.
        assert abs(x[0]) <= 3.0 * largest + 1e-12


@pytest.mark.parametrize(("stiffness", "damping"), [(0.0, 1.0), (-1.0, 1.0), (1.0, -1.0)])
def test_a_spring_that_pushes_or_a_damper_that_drives_is_refused(stiffness: float, damping: float):
    with pytest.raises(ValueError, match="sprung joints"):
        SprungDeflection(np.array([1.0, stiffness]), np.array([1.0, damping]), 4e-3)

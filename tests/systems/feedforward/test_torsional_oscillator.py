"""Three inertias on nonlinear springs, Reiner (2010) section 1.2: the inverse finds the torque for a path.

The equations of motion are written down anew from the free bodies; (1.2) of the source has wrong signs.
"""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp

from robots.drivetrain.stiffness import CubicSpring
from systems.feedforward.sprung_deflection import SprungDeflection

INERTIAS = np.array([0.5, 1.0, 2.0])  # kg m^2
SPRINGS = (CubicSpring(2000.0, 40.0), CubicSpring(1500.0, 60.0))  # (1.1)
DAMPINGS = (4.0, 3.0)  # N m s / rad
DURATION = 0.8  # s
# From 0 to 1 rad with four continuous derivatives, as the inverse needs them.
PATH = Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])(Polynomial([0.0, 1.0 / DURATION]))
DERIVATIVES = [PATH, *(PATH.deriv(n) for n in range(1, 5))]


def wanted(time: float) -> list[float]:
    """The angle of the third inertia and its first four derivatives."""
    return [float(derivative(time)) for derivative in DERIVATIVES]


def bent(spring: CubicSpring, damping: float, x: float, load: list[float]) -> list[float]:
    """Derivatives of a spring's deflection x by c(x) + d x' = load, as many as are known of the load."""
    c, slope, curvature = (
        float(spring.torque(np.array(x))),
        float(spring.stiffness(np.array(x))),
        6.0 * spring.c_0 * spring.gamma * x,
    )
    rates = [(load[0] - c) / damping]
    rates.append((load[1] - slope * rates[0]) / damping)
    if len(load) > 2:
        rates.append((load[2] - slope * rates[1] - curvature * rates[0] ** 2) / damping)
    return rates


def inverse(time: float, x_2: float, x_1: float) -> tuple[float, float, float, float]:
    """The torque at the first inertia, its angle, and how fast the two deflections change."""
    third = wanted(time)
    # The second spring accelerates the third inertia: phi_2 - phi_3 = x_2.
    load_2 = [INERTIAS[2] * a for a in third[2:]]
    rates_2 = bent(SPRINGS[1], DAMPINGS[1], x_2, load_2)
    second = [third[2] + rates_2[1], third[3] + rates_2[2]]  # its acceleration and jerk
    load_1 = [load_2[0] + INERTIAS[1] * second[0], load_2[1] + INERTIAS[1] * second[1]]
    rates_1 = bent(SPRINGS[0], DAMPINGS[0], x_1, load_1)
    torque = load_1[0] + INERTIAS[0] * (second[0] + rates_1[1])
    return torque, third[0] + x_2 + x_1, rates_2[0], rates_1[0]


def forward(angles: np.ndarray, rates: np.ndarray, torque: float) -> np.ndarray:
    """Accelerations of the three inertias."""
    inner = [
        float(spring.torque(angles[i] - angles[i + 1])) + damping * (rates[i] - rates[i + 1])
        for i, (spring, damping) in enumerate(zip(SPRINGS, DAMPINGS, strict=True))
    ]
    return (np.array([torque, *inner]) - np.array([*inner, 0.0])) / INERTIAS


def together(time: float, state: np.ndarray) -> np.ndarray:
    """The inverse (two deflections) and the forward model that gets its torque."""
    torque, _, rate_2, rate_1 = inverse(time, state[0], state[1])
    return np.concatenate([[rate_2, rate_1], state[5:], forward(state[2:5], state[5:], torque)])


@cache
def simulated() -> tuple[np.ndarray, np.ndarray]:
    times = np.linspace(0.0, DURATION, 201)
    found = solve_ivp(together, (0.0, DURATION), np.zeros(8), "LSODA", times, rtol=1e-10, atol=1e-12)
    return times, found.y


def test_the_torque_drives_the_forward_model_along_the_wanted_path():
    times, states = simulated()
    np.testing.assert_allclose(states[4], PATH(times), atol=1e-6)
    # The springs matter: they bend by hundredths of a radian, where they are a tenth stiffer than at rest.
    assert np.abs(states[:2]).max() > 0.01


def test_the_first_inertia_moves_as_the_inverse_says():
    times, states = simulated()
    angle = [inverse(time, *state[:2])[1] for time, state in zip(times, states.T, strict=True)]
    np.testing.assert_allclose(states[2], angle, atol=1e-6)


@pytest.mark.parametrize(("period", "tolerance"), [(2e-3, 2e-6), (1e-3, 5e-7)])
def test_tick_by_tick_the_deflection_is_the_same(period: float, tolerance: float):
    """`SprungDeflection` on the load of the second spring; its error is of the second order in the tick."""
    model = SprungDeflection(np.array([SPRINGS[1].c_0]), np.array([DAMPINGS[1]]), period, SPRINGS[1])
    times = np.arange(0.0, 0.5 * DURATION + 0.5 * period, period)
    x = np.zeros(1)
    for before, now in pairwise(times):
        x = model.step(x, *(-INERTIAS[2] * np.array([wanted(time)[2]]) for time in (before, now)))
    exact = solve_ivp(
        lambda t, x: bent(SPRINGS[1], DAMPINGS[1], x[0], [INERTIAS[2] * a for a in wanted(t)[2:]])[:1],
        (0.0, times[-1]),
        np.zeros(1),
        "Radau",
        rtol=1e-10,
        atol=1e-13,
    ).y[0, -1]
    assert x[0] == pytest.approx(exact, abs=tolerance)

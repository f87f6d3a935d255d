"""Two inertias and a spring, Reiner (2010) section 5.1: the inverse leaves a controller nothing to do."""

import numpy as np
from scipy.linalg import expm

from systems.feedforward.prefilter import Prefilter, PrefilterConfig
from systems.feedforward.sprung_deflection import SprungDeflection

MOTOR, LINK = 2.0, 5.0  # kg m^2
STIFFNESS, DAMPING = 8e3, 6.0  # N m / rad, N m s / rad
CUTOFF_HZ, PERIOD = 5.0, 2e-3


def chain(plant_stiffness: float = STIFFNESS) -> np.ndarray:
    """Prefilter, inverse and plant as one linear system x' = A x; the last state is the wanted angle, held.

    x = filtered angle and its two derivatives; the motor angle of the inverse (5.3); link angle and velocity,
    motor angle and velocity of the plant (5.1); the wanted angle.
    """
    A = np.zeros((9, 9))
    w = 2.0 * np.pi * CUTOFF_HZ
    A[0, 1] = A[1, 2] = 1.0
    third = np.array([-(w**3), -3.0 * w**2, -3.0 * w, 0.0, 0.0, 0.0, 0.0, 0.0, w**3])
    A[2] = third
    # d phi_m' + c phi_m = Theta_a phi_a'' + d phi_a' + c phi_a, and its derivative
    A[3, :4] = np.array([STIFFNESS, DAMPING, LINK, -STIFFNESS]) / DAMPING
    acceleration = (LINK * third + DAMPING * np.eye(9)[2] + STIFFNESS * (np.eye(9)[1] - A[3])) / DAMPING
    torque = MOTOR * acceleration + LINK * np.eye(9)[2]
    A[4, 5] = A[6, 7] = 1.0
    A[5, 4:8] = np.array([-plant_stiffness, -DAMPING, plant_stiffness, DAMPING]) / LINK
    A[7, 4:8] = np.array([plant_stiffness, DAMPING, -plant_stiffness, -DAMPING]) / MOTOR
    A[7] += torque / MOTOR
    return A


def run(wanted: np.ndarray, plant_stiffness: float = STIFFNESS) -> np.ndarray:
    """States at the ticks, exact for an angle that is held within a tick; (n, 9)."""
    step, x, states = expm(chain(plant_stiffness) * PERIOD), np.zeros(9), []
    for angle in wanted:
        x[8] = angle
        x = step @ x
        states.append(x.copy())
    return np.array(states)


WANTED = np.repeat([0.0, 1.0, -0.5, 0.7, 0.7], 100)


def test_the_inverse_and_the_plant_have_the_same_motor_angle():
    states = run(WANTED)
    assert np.ptp(states[:, 6]) > 1.0
    np.testing.assert_allclose(states[:, 3], states[:, 6], atol=1e-9)


def test_the_link_is_where_the_prefilter_wants_it():
    states = run(WANTED)
    np.testing.assert_allclose(states[:, 4], states[:, 0], atol=1e-9)


def test_the_prefilter_gives_the_derivatives_that_the_inverse_takes():
    states = run(WANTED)
    config = PrefilterConfig("critically_damped", 3, CUTOFF_HZ)
    model = Prefilter(config, PERIOD, needed=3)
    state = model.at_rest(np.zeros(1))
    for expected, angle in zip(states, WANTED, strict=True):
        state = model.step(state, np.array([angle]), np.array([angle]))
        # Derivatives of a radian in thirty rad/s are of the size of 1, 30 and 1000.
        np.testing.assert_allclose(state[:, 0] / [1.0, 30.0, 1e3], expected[:3] / [1.0, 30.0, 1e3], atol=1e-9)


def test_tick_by_tick_the_motor_angle_is_that_of_the_plant():
    """`Prefilter` and `SprungDeflection`, of which the feedforwards consist; wrong by the square of the tick.

    The load's curvature over K, which begins with 6e2 / s^2, times an eighth of the tick squared.
    """
    period = 2e-6
    config = PrefilterConfig("critically_damped", 3, CUTOFF_HZ)
    model = Prefilter(config, period, needed=3)
    spring = SprungDeflection(np.array([STIFFNESS]), np.array([DAMPING]), period)
    state, deflection, wanted = model.at_rest(np.zeros(1)), np.zeros(1), np.ones(1)
    step, x = expm(chain() * period), np.eye(9)[8]
    gaps = []
    for _ in range(round(0.05 / period)):
        load = LINK * state[2]
        state = model.step(state, wanted, wanted)
        deflection = spring.step(deflection, load, LINK * state[2])
        x = step @ x
        gaps.append(state[0, 0] - deflection[0] - x[6])
    assert abs(x[6]) > 0.1
    assert np.abs(gaps).max() < 1e-9


def test_with_another_spring_in_the_plant_the_controller_has_something_to_do():
    states = run(WANTED, 0.8 * STIFFNESS)
    assert np.abs(states[:, 3] - states[:, 6]).max() > 1e-3

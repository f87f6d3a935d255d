"""The relaxed inverse: its equations hold, little effort leaves the exact one, zeros may change sides."""

import numpy as np
import pytest

from systems.feedforward.stable_inverse.bounded_inverse import (
    BoundedMotion,
    Motion,
    NoBoundedMotionError,
    bounded_motion,
    derivatives,
)
from systems.feedforward.stable_inverse.flexible_arm import Pencil
from systems.feedforward.stable_inverse.relaxed_inverse import relaxed_motion

STEP, SAMPLES = 2e-3, 600
TIMES = STEP * np.arange(SAMPLES)
WANTED = np.exp(-(((TIMES - 0.6) / 0.05) ** 2))  # m, of the output
LEVER, STIFFNESS = 0.6, 400.0
SIDES = np.tanh((TIMES - 0.6) / 0.1)  # from -1 to 1 in the middle of the motion


class Arm:
    """A motor and a spring behind it: (theta'' + x'') + d x' + c x = 0, output theta + lever * x.

    Its zeros are those of (1 - lever) s^2 + d s + c: with a damping below zero in the right half-plane.
    """

    def __init__(self, damping: np.ndarray):
        mass, stiffness = np.array([[0.0, 0.0], [1.0, 1.0]]), np.array([[1.0, LEVER], [0.0, STIFFNESS]])
        friction = damping[:, None, None] * np.diag([0.0, 1.0])
        self.linear = Pencil(np.tile(mass, (SAMPLES, 1, 1)), friction, np.tile(stiffness, (SAMPLES, 1, 1)))

    def residuals(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        matrices = self.linear.stiffness, self.linear.damping, self.linear.mass
        equations = np.zeros((SAMPLES, 2))
        for matrix, part in zip(matrices, motion, strict=True):
            equations += np.einsum("kij,kj->ki", matrix, part)
        equations[:, 0] -= WANTED
        return equations, equations

    def exact(self) -> BoundedMotion:
        start = np.zeros((SAMPLES, 2))
        return bounded_motion(start, STEP, self.linear, self.residuals, num_outputs=1)

    def relaxed(self, effort: float) -> BoundedMotion:
        start, motors = np.zeros((SAMPLES, 2)), np.array([0])
        return relaxed_motion(start, STEP, self.linear, self.residuals, motors, effort, num_outputs=1)


@pytest.mark.parametrize("damping", [36.0 + 0.0 * SIDES, -36.0 + 0.0 * SIDES, 36.0 * SIDES, -36.0 * SIDES])
def test_from_rest_to_rest_the_equation_of_the_spring_holds(damping: np.ndarray):
    found = Arm(damping).relaxed(1e-5)
    q = np.pad(found.motion[0], ((4, 4), (0, 0)), mode="edge")  # at rest for good
    v, vdot = derivatives(q, STEP)
    spring = vdot.sum(axis=1) + np.pad(damping, 4, mode="edge") * v[:, 1] + STIFFNESS * q[:, 1]
    assert np.abs(spring).max() < 1e-6  # N m of some 1e3; the ends give way by 1e-12 of a weight


@pytest.mark.parametrize("damping", [36.0, -36.0])
def test_little_effort_leaves_the_exact_inverse(damping: float):
    """Which knows no ends, and dies away to 1e-9 there."""
    arm = Arm(np.full(SAMPLES, damping))
    exact = arm.exact().motion[0]
    apart = [np.abs(arm.relaxed(effort).motion[0] - exact).max() for effort in (1e-4, 1e-6)]
    assert apart[1] < 0.1 * apart[0]
    assert apart[1] < 0.01 * np.abs(exact).max()


def test_no_other_motion_is_cheaper():
    """Along any change of the motor, with the spring's answer to it, the cost rises on both sides alike."""
    arm, effort = Arm(np.full(SAMPLES, 36.0)), 1e-4
    motor = arm.relaxed(effort).motion[0][:, 0]

    def cost(motor: np.ndarray) -> float:
        bent = np.diff(motor, 2, prepend=motor[0], append=motor[-1]) / STEP**2
        acceleration = derivatives(motor[:, None], STEP)[1][:, 0]
        s = 2j * np.pi * np.fft.rfftfreq(SAMPLES, STEP)
        spring = np.fft.irfft(np.fft.rfft(-acceleration) / (s**2 + 36.0 * s + STIFFNESS), SAMPLES)
        errors = motor + LEVER * spring - WANTED
        return float(errors @ errors + effort**2 * bent @ bent)

    least = cost(motor)
    for centre in (0.3, 0.5, 0.7):
        change = 1e-2 * np.exp(-(((TIMES - centre) / 0.04) ** 2))
        up, down = cost(motor + change), cost(motor - change)
        assert min(up, down) > least
        assert abs(up - down) < 0.02 * (up + down - 2.0 * least)


def test_where_zeros_change_sides_it_stays_near_the_path():
    """The mode dies away towards the middle from both ends: there are two conditions too few."""
    arm = Arm(36.0 * SIDES)
    relaxed = arm.relaxed(1e-6)
    assert relaxed.history[-1] < 0.03  # of the one metre
    assert np.abs(relaxed.motion[0]).max() < 0.7 * np.abs(arm.exact().motion[0]).max()


def test_what_does_not_end_is_refused():
    arm, asked = Arm(np.full(SAMPLES, 36.0)), []

    def residuals(motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        asked.append(motion)
        return np.full((SAMPLES, 2), 0.1 * (-1.0) ** len(asked)), np.zeros(0)

    start, motors = np.zeros((SAMPLES, 2)), np.array([0])
    with pytest.raises(NoBoundedMotionError, match="does not converge in 25 iterations"):
        relaxed_motion(start, STEP, arm.linear, residuals, motors, 1e-5, num_outputs=1)

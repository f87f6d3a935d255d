"""The bounded solution of a linear inverse: exact, as Fourier finds it, early only where it must be."""

import numpy as np
import pytest

from systems.feedforward.stable_inverse.bounded_inverse import (
    BoundedMotion,
    NoBoundedMotionError,
    bounded_motion,
)
from systems.feedforward.stable_inverse.flexible_arm import Pencil

STEP, SAMPLES = 2e-3, 1000
TIMES = STEP * np.arange(SAMPLES)
WANTED = np.exp(-(((TIMES - 0.9) / 0.05) ** 2))  # m, of the output
STIFFNESS, DAMPING = 400.0, 12.0  # N m / rad, N m s / rad


def matrices(lever: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A motor and a spring behind it; the output is motor + lever * spring.

    The spring obeys m (theta'' + x'') + d x' + c x = 0. Beyond a lever of one the zeros are real, one in the
    right half-plane.
    """
    mass = np.array([[0.0, 0.0], [1.0, 1.0]])
    return mass, np.diag([0.0, DAMPING]), np.array([[1.0, lever], [0.0, STIFFNESS]])


def solved(lever: float) -> BoundedMotion:
    M, D, K = matrices(lever)

    def residuals(motion):
        q, v, vdot = motion
        equations = vdot @ M.T + v @ D.T + q @ K.T
        equations[:, 0] -= WANTED
        return equations, equations

    linear = Pencil(*(np.tile(matrix, (SAMPLES, 1, 1)) for matrix in (M, D, K)))
    return bounded_motion(np.zeros((SAMPLES, 2)), STEP, linear, residuals, num_outputs=1)


@pytest.mark.parametrize("lever", [0.6, 1.4])
def test_of_a_linear_system_the_output_is_exact_but_for_rounding(lever: float):
    found = solved(lever)
    assert len(found.history) == 3
    assert found.history[-1] < 1e-13  # m
    inner = found.others[4:-4]  # the circle of samples closes where something dies away yet
    assert np.abs(inner).max() < 1e-9  # N m, the spring's equation at every sample


@pytest.mark.parametrize("lever", [0.6, 1.4])
def test_it_is_the_solution_in_the_frequency_domain(lever: float):
    """Which knows no direction of time; central differences err by some 1e-5 here."""
    M, D, K = matrices(lever)
    s = 2j * np.pi * np.fft.rfftfreq(SAMPLES, STEP)[:, None, None]
    drive = np.stack([np.fft.rfft(WANTED), np.zeros(len(s))], axis=1)
    expected = np.fft.irfft(
        np.linalg.solve(s**2 * M + s * D + K, drive[:, :, None])[:, :, 0], SAMPLES, axis=0
    )
    np.testing.assert_allclose(solved(lever).motion[0], expected, atol=1e-4)


def test_the_motor_moves_before_the_output_only_where_a_zero_is_unstable():
    """0.2 s before its middle the hump is at 1e-7."""
    before = TIMES < 0.7
    causal, acausal = (np.abs(solved(lever).motion[0][before]).max() for lever in (0.6, 1.4))
    assert causal < 1e-5
    assert acausal > 1e-3


def test_what_does_not_converge_is_refused():
    linear = Pencil(*(np.tile(matrix, (SAMPLES, 1, 1)) for matrix in matrices(0.6)))

    def residuals(motion):
        return np.ones((SAMPLES, 2)), np.zeros(0)

    with pytest.raises(NoBoundedMotionError, match="does not converge: the output is off by 1e"):
        bounded_motion(np.zeros((SAMPLES, 2)), STEP, linear, residuals, num_outputs=1, iterations=3)

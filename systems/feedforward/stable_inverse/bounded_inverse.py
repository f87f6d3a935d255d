"""The bounded solution of equations whose inverse is unstable, for a motion that is known from start to end.

An inverse with zeros in the right half-plane diverges when it is integrated forwards. From rest to rest the
same equations have one solution that is bounded, and it begins before the motion: Bayo (1987) for linear
arms, Devasia, Chen and Paden (1996) for nonlinear ones. Here all samples are unknowns at once: derivatives
are central differences of fourth order, and Newton's method solves a banded system about the wanted motion.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg import get_lapack_funcs

from systems.feedforward.stable_inverse.flexible_arm import Pencil

# Of the samples from two before to two after.
FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0
REACH = 2  # samples
_PATIENCE = 3  # iterations, in which the error has to fall
_STAGNATING = 0.7  # to this share; where there is a solution it falls to a tenth in each

Motion = tuple[np.ndarray, np.ndarray, np.ndarray]


class BoundedMotion(NamedTuple):
    """A motion that obeys its equations."""

    motion: Motion  # positions and two derivatives, shape (samples, n) each
    others: np.ndarray  # what the residual function gave beside the equations
    history: list[float]  # the largest error of the outputs before each iteration, and at the end


class NoBoundedMotionError(ValueError):
    """The iteration has not converged."""


def bounded_motion(
    start: np.ndarray,
    period: float,
    linear: Pencil,
    residuals: Callable[[Motion], tuple[np.ndarray, np.ndarray]],
    tolerance: float = 1e-8,
    iterations: int = 25,
    num_outputs: int = 3,
) -> BoundedMotion:
    """Finds positions whose residuals vanish; at rest before the first sample and after the last one.

    Args:
        start: positions to begin with, shape (samples, n).
        period: between two samples in s.
        linear: the equations, linear about the wanted motion; its matrices of shape (samples, n, n).
        residuals: of a motion, the equations (samples, n) and whatever else belongs to the result.
        tolerance: of the outputs, in their unit; reached twice, so that the rest of the equations holds, too.
        iterations: at most.
        num_outputs: how many equations, the first ones, are outputs.

    Raises:
        NoBoundedMotionError: if the outputs stay further off.
    """
    solve = _solver(linear, period)
    positions, history = start, []
    for _ in range(iterations + 1):
        motion = (positions, *derivatives(positions, period))
        equations, others = residuals(motion)
        history.append(float(np.linalg.norm(equations[:, :num_outputs], axis=1).max()))
        # The first error is that of the rests between which the motion is drawn, and not of an iteration.
        if not history[-1] <= 1.0 or history[-1] > _STAGNATING * min(history[1:-_PATIENCE], default=np.inf):
            break
        if len(history) > 2 and max(history[-2:]) <= tolerance:
            return BoundedMotion(motion, others, history)
        positions = positions - solve(equations)
    raise NoBoundedMotionError(
        f"the stable inverse does not converge: the output is off by {1e3 * min(history):.3g} mm at best "
        f"after {len(history) - 1} iterations"
    )


def derivatives(positions: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """First and second derivative of samples (samples, n) that are at rest before and after."""
    padded = np.pad(positions, ((REACH, REACH), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * REACH + 1, axis=0)
    return windows @ FIRST / period, windows @ SECOND / period**2


def _solver(linear: Pencil, period: float) -> Callable[[np.ndarray], np.ndarray]:
    """Factorises the equations of all samples at once; a function of their right sides, (samples, n).

    What dies away forwards needs a condition at the start, what dies away backwards one at the end.
    Neighbours of the first sample are the last ones: then each finds its own, for in between is time to die
    away. The samples are taken in turns from both ends, which makes the circle a band.
    """
    samples, n, _ = linear.mass.shape
    # Equations in m beside others in N m: of one size for the pivots.
    scale = 1.0 / np.abs(linear.stiffness).max(axis=(0, 2))
    band = (2 * REACH + 1) * n - 1
    banded = np.zeros((3 * band + 1, samples * n))
    each = np.arange(samples)
    place = np.where(2 * each < samples, 2 * each, 2 * (samples - 1 - each) + 1)
    within = np.arange(n)
    for offset, first, second in zip(range(-REACH, REACH + 1), FIRST, SECOND, strict=True):
        block = second / period**2 * linear.mass + first / period * linear.damping
        if offset == 0:
            block = block + linear.stiffness
        row = (n * place[:, None] + within)[:, :, None]
        column = (n * np.roll(place, -offset)[:, None] + within)[:, None, :]
        banded[2 * band + row - column, np.broadcast_to(column, block.shape)] = scale[:, None] * block
    factorise, substitute = get_lapack_funcs(("gbtrf", "gbtrs"), dtype=float)
    factors, pivots, info = factorise(banded, band, band, overwrite_ab=True)
    if info != 0:
        raise NoBoundedMotionError("the stable inverse is singular: the motors cannot move the point there")

    def solve(equations: np.ndarray) -> np.ndarray:
        turns = np.empty_like(equations)
        turns[place] = scale * equations
        found, _ = substitute(factors, band, band, turns.ravel(), pivots)
        return found.reshape(samples, n)[place]

    return solve

"""The motion that obeys the equations of an arm and leaves its path as little as its motors' effort is worth.

Where a zero comes near the imaginary axis or crosses it on the way, the exact inverse rings long before and
after the path, or does not exist: conditions at the ends and modes differ in number. A least-squares problem
has a solution for any zeros: weighed are the errors of the outputs and how the motors accelerate beyond a
motion that is nearly right, and the equations of all sprung joints hold exactly, from rest to rest.
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import get_lapack_funcs

from systems.feedforward.stable_inverse.bounded_inverse import (
    FIRST,
    REACH,
    SECOND,
    BoundedMotion,
    Motion,
    NoBoundedMotionError,
    derivatives,
)
from systems.feedforward.stable_inverse.flexible_arm import Pencil

_HELD = 1e12  # of the weight of an output
_CURVATURE = np.array([1.0, -2.0, 1.0])  # second difference, of the sample before to the one after


def relaxed_motion(
    start: np.ndarray,
    period: float,
    linear: Pencil,
    residuals: Callable[[Motion], tuple[np.ndarray, np.ndarray]],
    motors: np.ndarray,
    effort: float,
    tolerance: float = 1e-9,
    iterations: int = 25,
    num_outputs: int = 6,
) -> BoundedMotion:
    """Finds positions that minimise (errors of outputs)^2 + (effort * additional acceleration of motors)^2.

    Args:
        start: positions to begin with, at rest before and after them, shape (samples, n).
        period: between two samples in s.
        linear: the equations, linear about the wanted motion; its matrices of shape (samples, n, n).
        residuals: of a motion, the equations (samples, n) and whatever else belongs to the result.
        motors: which positions are those of motors, shape (m,).
        effort: which error (in m or rad) an additional acceleration of 1 rad/s^2 is worth.
        tolerance: of the last change of the positions in rad.
        iterations: at most.
        num_outputs: how many equations, the first ones, are outputs; the others hold.

    Raises:
        NoBoundedMotionError: if the iteration does not end.
    """
    solve = _solver(linear, period, motors, effort, num_outputs)
    beyond, history = np.zeros_like(start), []
    for _ in range(iterations):
        positions = start + beyond
        motion = (positions, *derivatives(positions, period))
        equations, others = residuals(motion)
        history.append(float(np.linalg.norm(equations[:, : min(3, num_outputs)], axis=1).max()))
        if not history[-1] <= 1.0:
            break
        step = solve(equations, beyond)
        if len(history) > 1 and np.abs(step).max() <= tolerance:
            return BoundedMotion(motion, others, history)
        beyond = beyond - step
    raise NoBoundedMotionError(
        f"the relaxed stable inverse does not converge in {len(history)} iterations: the output is off by "
        f"{1e3 * history[-1]:.3g} mm"
    )


def _solver(
    linear: Pencil, period: float, motors: np.ndarray, effort: float, num_outputs: int
) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Factorises the conditions of the minimum; a function of equations and positions beyond the start.

    Per sample n positions and a multiplier for each equation that holds.
    """
    samples, n, _ = linear.mass.shape
    holding = n - num_outputs
    size = n + holding
    outputs = linear.stiffness[:, :num_outputs]
    scale = 1.0 / np.abs(linear.stiffness[:, num_outputs:]).max(axis=(0, 2))
    band = REACH * size + size - 1
    banded = np.zeros((3 * band + 1, samples * size))
    each, within, multipliers = np.arange(samples), np.arange(n), n + np.arange(holding)

    def add(of_row: np.ndarray, rows: np.ndarray, of_column: np.ndarray, columns: np.ndarray, block) -> None:
        row = (size * of_row[:, None] + rows)[:, :, None]
        column = (size * of_column[:, None] + columns)[:, None, :]
        np.add.at(banded, (2 * band + row - column, np.broadcast_to(column, block.shape)), block)

    add(each, within, each, within, np.swapaxes(outputs, 1, 2) @ outputs)
    # Rest needs positions and velocities: two samples at each end stay where they are.
    ends = np.r_[:REACH, samples - REACH : samples]
    add(ends, within, ends, within, np.broadcast_to(_HELD * np.eye(n), (len(ends), n, n)))
    curved = effort / period**2 * _CURVATURE
    for first, a in enumerate(curved):
        for second, b in enumerate(curved):
            block = np.broadcast_to(a * b * np.eye(len(motors)), (samples, len(motors), len(motors)))
            i, j = (np.clip(each + shift - 1, 0, samples - 1) for shift in (first, second))
            add(i, motors, j, motors, block)
    for offset, first, second in zip(range(-REACH, REACH + 1), FIRST, SECOND, strict=True):
        block = second / period**2 * linear.mass + first / period * linear.damping
        if offset == 0:
            block = block + linear.stiffness
        block = scale[:, None] * block[:, num_outputs:]
        other = np.clip(each + offset, 0, samples - 1)
        add(each, multipliers, other, within, block)
        add(other, within, each, multipliers, np.swapaxes(block, 1, 2))
    factorise, substitute = get_lapack_funcs(("gbtrf", "gbtrs"), dtype=float)
    factors, pivots, info = factorise(banded, band, band, overwrite_ab=True)
    if info != 0:
        raise NoBoundedMotionError("the relaxed stable inverse is singular")

    def solve(equations: np.ndarray, beyond: np.ndarray) -> np.ndarray:
        right = np.zeros((samples, size))
        right[:, :n] = np.einsum("kij,ki->kj", outputs, equations[:, :num_outputs])
        padded = np.pad(beyond[:, motors], ((1, 1), (0, 0)), mode="edge")
        bent = np.diff(padded, 2, axis=0)
        for shift, a in zip((-1, 0, 1), effort**2 / period**4 * _CURVATURE, strict=True):
            place = np.clip(each + shift, 0, samples - 1)
            np.add.at(right, (place[:, None], motors[None]), a * bent)
        right[ends, :n] += _HELD * beyond[ends]
        right[:, n:] = scale * equations[:, num_outputs:]
        found, _ = substitute(factors, band, band, right.ravel(), pivots)
        return found.reshape(samples, size)[:, :n]

    return solve

"""An output beside the wanted one, equal to it at rest, whose zeros are where one wants them.

Niemiec and Kravaris (2003); Reiner (2010), eqs. (3.43) to (3.49), for linear systems with one input and one
output. The exact inverse with respect to it is stable; on the way it leaves the wanted output.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

_ILL_CONDITIONED = 1e-6  # how far the zeros may be from where they are wanted, relative


@dataclass(frozen=True)
class VirtualOutput:
    """h_A = h + sum psi_j q_j.

    Attributes:
        weights: psi of (3.43), shape (n - 1,).
        row: h_A as a row of the state, shape (n,).
        numerator: of its transfer function, in s; its roots are the zeros.
        error: how far these are from the wanted ones, relative to the largest.
    """

    weights: np.ndarray
    row: np.ndarray
    numerator: Polynomial
    error: float


def virtual_output(A: np.ndarray, B: np.ndarray, C: np.ndarray, wanted: np.ndarray) -> VirtualOutput:
    """Finds the weights by comparison of coefficients, (3.46).

    Args:
        A: of dx/dt = A x + B u, shape (n, n).
        B: shape (n,); the last one must not vanish, see (3.49): the states are put in order before.
        C: of y = C x, shape (n,).
        wanted: n - 1 zeros in 1/s, in the left half-plane; complex ones in pairs.

    Raises:
        ValueError: if their number is wrong, one is not in the left half-plane, or they cannot be reached.
    """
    n = len(A)
    wanted = np.asarray(wanted, dtype=complex)
    if wanted.shape != (n - 1,):
        raise ValueError(f"virtual output: {n - 1} zeros are wanted for {n} states, got {wanted.size}")
    if not (np.real(wanted) < 0.0).all():
        raise ValueError("virtual output: all wanted zeros must have a negative real part")
    if abs(B[-1]) < 1e-12 * np.abs(B).max():
        raise ValueError(
            "virtual output: the input must act on the last state; put the states in another order"
        )
    # (3.45): what of the first n - 1 states does not depend on the input; zero at rest.
    rest = A[:-1] - np.outer(B[:-1] / B[-1], A[-1])

    from scipy.signal import ss2tf  # here: half a second that few need

    def numerator(row: np.ndarray) -> np.ndarray:
        found, _ = ss2tf(A, B[:, None], row[None], np.zeros((1, 1)))
        return found[0][::-1][:n]

    own = numerator(C)
    product = np.real(Polynomial([1.0]).coef)
    for zero in wanted:
        product = np.convolve(product, [1.0, -1.0 / zero])
    target = own[0] * np.real(product)
    columns = np.array([numerator(row) for row in rest]).T
    scale = np.abs(wanted).max() ** np.arange(n)  # coefficients of powers of s beside each other
    weights = np.linalg.lstsq(columns * scale[:, None], (target - own) * scale, rcond=None)[0]
    row = C + weights @ rest
    reached = Polynomial(numerator(row))
    error = float(np.abs((reached.coef - target) * scale).max() / np.abs(target * scale).max())
    if not error < _ILL_CONDITIONED:
        raise ValueError(
            f"virtual output: the zeros cannot be placed so; {error:.1e} of a coefficient is missing"
        )
    return VirtualOutput(weights, row, reached, error)

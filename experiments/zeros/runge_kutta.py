"""States of small systems by the classical Runge-Kutta method, as one function of casadi."""

import casadi as ca
import numpy as np


def march(rates: ca.Function, start: np.ndarray, inputs: np.ndarray, step: float) -> np.ndarray:
    """States at evenly spaced times.

    Args:
        rates: derivative of the state, of state (n,) and input (m,).
        start: state at the first time, shape (n,).
        inputs: at these times and at the middles between them, shape (2 k + 1, m).
        step: in s.

    Returns:
        Shape (k + 1, n).
    """
    n, m = len(start), inputs.shape[1]
    x, u = ca.MX.sym("x", n), ca.MX.sym("u", 3 * m)
    first, middle, last = ca.vertsplit(u, m)
    k1 = rates(x, first)
    k2 = rates(x + 0.5 * step * k1, middle)
    k3 = rates(x + 0.5 * step * k2, middle)
    k4 = rates(x + step * k3, last)
    one = ca.Function("step", [x, u], [x + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)])
    steps = (len(inputs) - 1) // 2
    columns = np.hstack([inputs[:-2:2], inputs[1::2], inputs[2::2]]).T
    found = np.asarray(one.mapaccum(steps)(start, columns))
    return np.vstack([start, found.T])

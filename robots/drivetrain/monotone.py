"""The inverse of a monotone function, for many numbers at once."""

from collections.abc import Callable

import numpy as np

_DOUBLINGS, _HALVINGS, _NEWTON_STEPS = 60, 30, 6


def monotone_inverse(
    function: Callable[[np.ndarray], np.ndarray],
    slope: Callable[[np.ndarray], np.ndarray],
    target: np.ndarray,
    scale: np.ndarray | float,
) -> np.ndarray:
    """Arguments at which an increasing odd-signed function has given values.

    Brackets grow from zero, are halved, and Newton's method ends to rounding where the slope is smooth.

    Args:
        function: increasing, with the sign of its argument; arrays in, arrays out.
        slope: its derivative.
        target: wanted values, any shape.
        scale: a first guess of the size of the argument, positive.

    Returns:
        Arguments, in the shape of ``target``.

    Raises:
        ValueError: if the function does not reach a value.
    """
    target = np.asarray(target, dtype=float)
    sign, size = np.sign(target), np.broadcast_to(np.asarray(scale, dtype=float), target.shape).copy()
    for _ in range(_DOUBLINGS):
        short = np.abs(function(sign * size)) < np.abs(target)
        if not short.any():
            break
        size = np.where(short, 2.0 * size, size)
    else:
        raise ValueError("the value is out of the range of the model")
    lower, upper = np.minimum(0.0, sign * size), np.maximum(0.0, sign * size)
    for _ in range(_HALVINGS):
        middle = 0.5 * (lower + upper)
        below = function(middle) < target
        lower, upper = np.where(below, middle, lower), np.where(below, upper, middle)
    x = 0.5 * (lower + upper)
    for _ in range(_NEWTON_STEPS):
        derivative = slope(x)
        step = (target - function(x)) / np.where(derivative > 0.0, derivative, np.inf)
        x = np.clip(x + step, lower, upper)
    return x

"""Where the joints are along a path: a smooth function q(s) of a parameter from 0 to 1."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import takewhile

import numpy as np
from numpy.polynomial import chebyshev

from robots.description.model import RobotModel

_DEGREES = (6, 8, 10, 12, 15, 18, 22, 27, 33, 40, 50, 60, 70, 85, 100)  # of the polynomials that are tried
HIGHEST = 50  # of them: what needs more is not smooth, as a rule
_LOOKED_AT = 201  # parameters
_ROUNDING = 1e-9  # rad
_NEGLIGIBLE = 3e-6  # rad: a motion by less lasts no tick, and its timing is all rounding
_SMALL = 1e-7  # rad: the last coefficients of a polynomial that is good enough


class PathError(ValueError):
    """A path that no motion can follow, with the place on it."""


@dataclass(frozen=True)
class Curve:
    """A polynomial in s from 0 to 1, as a sum of Chebyshev polynomials of 2 s - 1."""

    coefficients: np.ndarray  # (degree + 1, ...)

    def at(self, s: np.ndarray, order: int = 0) -> np.ndarray:
        """The curve or a derivative by s at parameters of shape (n,), shape (n, ...)."""
        coefficients = self.derivative(order).coefficients
        return np.moveaxis(chebyshev.chebval(2.0 * np.asarray(s) - 1.0, coefficients), -1, 0)

    def derivative(self, order: int) -> "Curve":
        """The derivative by s of an order, the curve itself at 0."""
        return Curve(chebyshev.chebder(self.coefficients, order, scl=2.0)) if order else self


def nodes(degree: int) -> np.ndarray:
    """Parameters in rising order at which a polynomial of this degree is determined best, (degree + 1,)."""
    return 0.5 - 0.5 * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))


def interpolated(values: np.ndarray) -> Curve:
    """The polynomial through values at `nodes`, shape (degree + 1, ...)."""
    degree = len(values) - 1
    flat = values.reshape(degree + 1, -1)
    vandermonde = chebyshev.chebvander(2.0 * nodes(degree) - 1.0, degree)
    return Curve(np.linalg.solve(vandermonde, flat).reshape(values.shape))


def smooth_curve(
    function: Callable[[np.ndarray], np.ndarray],
    what: str,
    scale: np.ndarray | float = 1.0,
    accuracy: float = _SMALL,
    highest: int = HIGHEST,
) -> Curve:
    """The polynomial of low degree that a function of s is.

    Args:
        function: of parameters (n,) in rising order, values (n, k).
        what: the function is, for the refusal.
        scale: of its values, shape (k,) or one number.
        accuracy: share of the scale by which the polynomial may be off.
        highest: degree that is tried.

    Raises:
        PathError: if it has a corner or is singular; with the place.
    """
    for degree in takewhile(lambda each: each <= highest, _DEGREES):
        curve = interpolated(function(nodes(degree)))
        if (np.abs(curve.coefficients[-3:]) <= accuracy * scale).all():
            return curve
    s = np.linspace(0.0, 1.0, 400)
    worst = int((np.abs(curve.at(s) - function(s)) / scale).max(axis=1).argmax())
    raise PathError(
        f"{what} is not smooth near {100.0 * s[worst]:.0f} % of the path: a corner, or an arm nearly singular"
    )


def straight_joint_path(start: np.ndarray, goal: np.ndarray) -> Curve:
    """All joints from start to goal in rad, shape (6,) each, in proportion.

    Raises:
        PathError: if nothing moves.
    """
    if not np.abs(goal - start).max() > 0.0:
        raise PathError("the motion ends where it starts: no joint moves")
    return Curve(np.array([0.5 * (start + goal), 0.5 * (goal - start)]))


def require_motion(path: Curve) -> None:
    """Refuses a path on which next to nothing moves.

    Raises:
        PathError: with how far the joints move.
    """
    q = path.at(np.linspace(0.0, 1.0, _LOOKED_AT))
    most = float(np.abs(q - q[0]).max())
    if most < _NEGLIGIBLE:
        raise PathError(
            f"the motion is negligible: no joint moves by more than {np.rad2deg(most):.2g} deg, "
            f"{np.rad2deg(_NEGLIGIBLE):.2g} deg are the least"
        )


def require_in_range(robot: RobotModel, path: Curve) -> None:
    """Refuses a path on which a joint is outside its range.

    Raises:
        PathError: with the joint and the place.
    """
    s = np.linspace(0.0, 1.0, _LOOKED_AT)
    q = path.at(s)
    outside = np.maximum(robot.lower - q, q - robot.upper)
    row, joint = np.unravel_index(outside.argmax(), outside.shape)
    if outside[row, joint] > _ROUNDING:
        lower, upper = np.rad2deg([robot.lower[joint], robot.upper[joint]])
        raise PathError(
            f"joint {joint + 1} must be between {lower:.6g} and {upper:.6g} deg, but is at "
            f"{np.rad2deg(q[row, joint]):.6g} deg at {100.0 * s[row]:.0f} % of the path"
        )

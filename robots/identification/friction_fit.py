"""Which kind of friction a joint has, and with which numbers: kinds of the kit, compared.

The criterion is Schwarz's (1978), n ln(rss / n) + k ln(n) for k numbers that are fitted to n torques: a kind
with more numbers has to fit clearly better.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from robots.description import drive_parts

Friction = drive_parts.Sigmoid | drive_parts.Stribeck | drive_parts.Polynomial
_SMALLEST = 1e-3  # of the largest torque


@dataclass(frozen=True)
class FrictionFit:
    """The best of one kind."""

    friction: Friction
    criterion: float  # the smaller, the better
    spread: float  # N m, of the torques about the curve

    @property
    def kind(self) -> str:
        """Its name in robot files."""
        return type(self.friction).__name__

    def torque(self, rate: np.ndarray) -> np.ndarray:
        """In N m at speeds in rad/s, any shape."""
        return self.friction.part().torque(rate)


@dataclass(frozen=True)
class _Kind:
    """How one kind is made of numbers, and where these begin: speeds in rad/s, torques in N m."""

    make: Callable[..., Friction]
    start: Callable[[np.ndarray, np.ndarray], Sequence[float]]
    positive: int  # how many numbers, all of them positive


def fit_frictions(rate: np.ndarray, torque: np.ndarray) -> list[FrictionFit]:
    """All kinds, the best first.

    Args:
        rate: of one joint in rad/s, shape (n,), of samples in which it moves.
        torque: what friction took then in N m, with the sign of the speed, shape (n,).

    Raises:
        ValueError: if there are fewer than ten samples or they have one direction only.
    """
    rate, torque = np.asarray(rate, dtype=float), np.asarray(torque, dtype=float)
    if len(rate) < 10 or not (rate.min() < 0.0 < rate.max()):
        raise ValueError(
            f"friction: needs ten samples or more in both directions, got {len(rate)} from "
            f"{rate.min(initial=0.0):g} to {rate.max(initial=0.0):g} rad/s"
        )
    found = [_fitted(kind, rate, torque) for kind in _KINDS]
    return sorted((each for each in found if each is not None), key=lambda each: each.criterion)


def _fitted(kind: _Kind, rate: np.ndarray, torque: np.ndarray) -> FrictionFit | None:
    size = float(np.abs(torque).max())
    start = np.log(np.maximum(kind.start(rate, torque), _SMALLEST * np.array([size, 1.0]).min()))

    def residuals(p: np.ndarray) -> np.ndarray:
        try:
            return (kind.make(*np.exp(p)).part().torque(rate) - torque) / size
        except ValueError:  # numbers that make no friction of this kind
            return np.full(len(rate), 10.0)

    solved = least_squares(residuals, start, x_scale=1.0, loss="soft_l1", f_scale=0.05)
    try:
        friction = kind.make(*map(float, np.exp(solved.x)))
        left = friction.part().torque(rate) - torque
    except ValueError:
        return None
    n = len(rate)
    rss = max(float(left @ left), 1e-12 * size**2)
    criterion = n * np.log(rss / n) + len(start) * np.log(n)
    return FrictionFit(friction, float(criterion), float(np.sqrt(rss / n)))


def _line(rate: np.ndarray, torque: np.ndarray) -> tuple[float, float]:
    """Slope and torque at rest of a straight line through the faster half."""
    speed, against = np.abs(rate), torque * np.sign(rate)
    fast = speed >= np.median(speed)
    slope, at_rest = np.polyfit(speed[fast], against[fast], 1)
    return max(float(slope), 1e-3 * float(against.max())), max(float(at_rest), 0.1 * float(against.max()))


def _of_stribeck(rate: np.ndarray, torque: np.ndarray) -> Sequence[float]:
    speed, against = np.abs(rate), torque * np.sign(rate)
    slope, at_rest = _line(rate, torque)
    hump = float(np.max(against - slope * speed - at_rest))
    return slope, at_rest, 200.0, max(hump, 0.1 * at_rest), 2.0 * float(speed.min())


def _of_polynomial(rate: np.ndarray, torque: np.ndarray) -> Sequence[float]:
    slope, at_rest = _line(rate, torque)
    return at_rest, 200.0, 0.05, at_rest + slope, slope


_KINDS = (
    _Kind(drive_parts.Sigmoid, lambda v, t: (*_line(v, t), 200.0), 3),
    _Kind(drive_parts.Stribeck, _of_stribeck, 5),
    _Kind(drive_parts.Polynomial, _of_polynomial, 5),
)

"""A path that a planner has timed, between its samples."""

import numpy as np
from scipy.interpolate import make_interp_spline

from systems.reference.cartesian_path import CartesianPath
from systems.reference.planned_file import PlannedMotion

_DEGREE = 7  # six derivatives are continuous, of which a plan has five
_REST = 8  # samples before and after at which the motion is at rest


class PlannedPath(CartesianPath):
    """The desired pose, twist and acceleration of the tool at any time, as of its base class.

    Positions and quaternions are splines through the samples; a quaternion is brought to its length, and the
    angular velocity is twice its derivative times its conjugate.
    """

    continuous_derivatives = 5

    def __init__(self, motion: PlannedMotion, settle: float, dwell: float, laps: int = 1) -> None:
        """Lays the motion out in time.

        Args:
            motion: from rest to rest.
            settle: s before it begins.
            dwell: s at rest at the end.
            laps: how often it is run, one after the other.
        """
        samples = np.column_stack([motion.positions, motion.quaternions])
        padded = np.pad(samples, ((_REST, _REST), (0, 0)), mode="edge")
        times = motion.period * (np.arange(len(padded)) - _REST)
        self._spline = make_interp_spline(times, padded, _DEGREE)
        self._rates = [self._spline.derivative(order) for order in (1, 2)]
        self._length = motion.period * (len(samples) - 1)
        self._laps = laps
        self.path_start = settle
        self.lap_starts = settle + self._length * np.arange(laps)
        self.dwell_start = settle + laps * self._length
        self.duration = self.dwell_start + dwell

    def sample(self, time):
        """See the base class."""
        t = np.asarray(time, dtype=float) - self.path_start
        lap = np.clip(np.floor(t / self._length), 0, self._laps - 1)
        t = t - lap * self._length
        moving = ((t > 0.0) & (t < self._length))[..., None]
        inside = np.clip(t, 0.0, self._length)
        place = self._spline(inside)
        rate, acceleration = (np.where(moving, each(inside), 0.0) for each in self._rates)
        X = np.zeros((*t.shape, 4, 4))
        X[..., 3, 3] = 1.0
        X[..., :3, 3] = place[..., :3]
        X[..., :3, :3], w, dw = _rotation(place[..., 3:], rate[..., 3:], acceleration[..., 3:])
        V = np.concatenate([w, rate[..., :3]], axis=-1)
        return X, V, np.concatenate([dw, acceleration[..., :3]], axis=-1)


def _rotation(p: np.ndarray, dp: np.ndarray, ddp: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rotation, angular velocity and acceleration of a quaternion of about unit length."""
    length = np.linalg.norm(p, axis=-1, keepdims=True)
    w, x, y, z = np.moveaxis(p / length, -1, 0)
    R = np.empty((*p.shape[:-1], 3, 3))
    R[..., 0, 0], R[..., 1, 1] = 1.0 - 2.0 * (y * y + z * z), 1.0 - 2.0 * (x * x + z * z)
    R[..., 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    for i, j, a, b in ((0, 1, x * y, w * z), (0, 2, x * z, -w * y), (1, 2, y * z, w * x)):
        R[..., i, j], R[..., j, i] = 2.0 * (a - b), 2.0 * (a + b)
    # 2 p' conj(p) / |p|^2: its vector is the angular velocity, whatever the length does.
    squared = length**2
    omega = 2.0 * _vector_of_product(dp, p) / squared
    stretch = 2.0 * np.sum(p * dp, axis=-1, keepdims=True) / squared
    return R, omega, 2.0 * _vector_of_product(ddp, p) / squared - stretch * omega


def _vector_of_product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The vector part of a conj(b)."""
    return b[..., :1] * a[..., 1:] - a[..., :1] * b[..., 1:] - np.cross(a[..., 1:], b[..., 1:])

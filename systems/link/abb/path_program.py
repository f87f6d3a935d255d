"""A RAPID program that runs its own path (EGMMoveL) and takes path corrections, without its controller."""

import math

import numpy as np
from scipy.interpolate import CubicSpline

from robots.description.model import RobotModel
from robots.dynamics.newton_inverse import inverse_kinematics
from robots.kinematics.forward import Kinematics
from systems.reference.cartesian_path import CartesianPath
from systems.reference.joint_mover import smooth_motion
from systems.reference.path_frame import PathLine

_KNOTS = 0.02  # s, between configurations of the path
_TO_START = 0.15  # of the largest joint speeds, on the way to the path


class PathProgram:
    """The joints along a path, shifted by corrections in its frame. Times are since it began, in s."""

    def __init__(self, robot: RobotModel, path: CartesianPath, home: np.ndarray, lag: float) -> None:
        """Solves the path.

        Args:
            robot: as the controller knows it.
            path: of the program.
            home: joint positions (6,) in rad near which the path begins.
            lag: s, with which a correction is taken up.

        Raises:
            UnreachableError, JointLimitError: if the robot cannot follow the path.
            ValueError: if the path has no length.
        """
        self._line, self._path, self._lag = PathLine(path), path, lag
        self._kinematics, self._inverse = Kinematics(robot), inverse_kinematics(robot)
        times = np.arange(0.0, path.duration + _KNOTS, _KNOTS)
        joints = self._inverse.along(path.sample(times)[0], home)
        self._joints = CubicSpline(times, joints)
        self._rates = self._joints.derivative()
        self._speed = _TO_START * robot.speed
        self._from: np.ndarray | None = None
        self._asked_P = np.zeros(3)  # m
        self._shift_W = np.zeros(3)  # m, taken up so far
        self._index, self._time = 0, 0.0

    @property
    def duration(self) -> float:
        """Of the path with its rests, in s."""
        return self._path.duration

    def correct(self, shift_P: np.ndarray) -> None:
        """Takes a correction (3,) in m in the frame of the path; what lies along the path is ignored."""
        self._asked_P = np.array([0.0, *shift_P[1:]])

    def begin(self) -> None:
        """The program begins, or begins anew, from wherever the robot is then."""
        self._from = None
        self._index, self._time = 0, 0.0

    def at(self, time: float, planned: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
        """Reference (6,) in rad, its speed in rad/s, and whether the path is over.

        Args:
            time: s since the program began.
            planned: joint positions (6,) in rad where the robot stands as it begins.
        """
        if self._from is None:
            self._from = planned.copy()
        start = self._joints(0.0)
        position, velocity, left = smooth_motion(self._from, start, time, self._speed)
        if left > 0.0:
            self._time = time
            return position, velocity, False
        on_path = -left
        place = self._line.place(self._path.sample(on_path)[0][:3, 3], self._index)
        share = 1.0 - math.exp(-max(0.0, time - self._time) / self._lag) if self._lag else 1.0
        self._index, self._time = place.index, time
        self._shift_W = self._shift_W + share * (place.R_WP @ self._asked_P - self._shift_W)
        nominal = self._joints(min(on_path, self.duration))
        X_WE = self._kinematics.forward(nominal)
        X_WE[:3, 3] += self._shift_W
        is_over = on_path >= self.duration
        rates = np.zeros_like(nominal) if is_over else self._rates(on_path)
        return self._inverse.nearest(X_WE[:3], nominal), rates, is_over

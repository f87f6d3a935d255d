"""Analytic inverse kinematics of six-axis robots with a spherical wrist: all branches, or the nearest.

Probst (2024), section 2.1.2, eqs. (2.13) to (2.27), for any tool, any base, any zeros of the joints, offsets
in the plane of the arm and an arm beside axis 1. A pose has up to eight solutions: two of the shoulder (c1 =
1 reaches forward, -1 backward over the head), two of the elbow (c2 = 1, -1) and two of the wrist (flipped or
not).

The formulas are written once, for floats and for arrays: their argument ``m`` is ``math`` for one pose,
which is fast, or its counterpart for arrays, ``_ARRAYS``, for many.
"""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.kinematics.arm_structure import arm_structure
from robots.pose import wrap_angle

REACH_TOLERANCE = 1e-9  # m, a pose this far beyond the reach is taken as a stretched or a folded arm
LIMIT_TOLERANCE = 1e-9  # rad, an angle this far beyond a limit is put on the limit
_SINGULAR = 1e-9  # sine of joint 5, or distance in m of the wrist from axis 1, that leaves an angle open
_TURN = 2.0 * math.pi
_ARRAYS = SimpleNamespace(sin=np.sin, cos=np.cos, atan2=np.arctan2)
# (c1, c2, c5) in the order of `all_branches`; c5 is the sign of the sine of joint 5.
_BRANCHES = [(c1, c2, c5) for c1 in (1.0, -1.0) for c2 in (1.0, -1.0) for c5 in (1.0, -1.0)]


class UnreachableError(ValueError):
    """The wrist would have to be farther away, or closer, than the arm can reach."""


class JointLimitError(ValueError):
    """The pose can be reached, but only with a joint beyond its limits."""


class InverseKinematics:
    """Joint positions for poses of a robot's tool in the world."""

    def __init__(self, robot: RobotModel) -> None:
        """Takes the dimensions from the robot, with its base and its tool.

        Raises:
            ValueError: if the robot is not built as the method needs it; the message says what does not fit.
        """
        self.robot = robot
        arm = arm_structure(robot)
        offsets = arm.offsets
        self._signs, self._zeros = arm.signs.tolist(), arm.zeros
        self._lower, self._upper = (robot.lower - arm.zeros).tolist(), (robot.upper - arm.zeros).tolist()
        self._shoulder_x, self._shoulder_z = float(offsets[1, 0]), float(offsets[1, 2])
        # Upper arm 2-3 and forearm 3-5: lengths, and angles from z towards x at zero joint angles.
        (x23, _, z23), (x35, _, z35) = offsets[2].tolist(), (offsets[3] + offsets[4]).tolist()
        self._l23, self._angle23 = math.hypot(x23, z23), math.atan2(x23, z23)
        self._l35, self._angle35 = math.hypot(x35, z35), math.atan2(x35, z35)
        self._longest, self._shortest = self._l23 + self._l35, abs(self._l23 - self._l35)
        self._beside = float(offsets[3, 1])  # how far the plane of the arm is from axis 1
        # Frame 1: first joint. Frame H: on link 6 in the centre of the wrist. Both parallel to B at zero.
        X_W1 = arm.base.GetAsMatrix4()
        X_W1[:3, 3] += X_W1[:3, :3] @ offsets[0]
        X_HF = np.eye(4)
        X_HF[:3, :3], X_HF[:3, 3] = arm.R_BF, offsets[5]
        self._X_1W = np.linalg.inv(X_W1)
        self._X_EH = np.linalg.inv(X_HF @ arm.tool.GetAsMatrix4())

    def all_branches(self, X_WE: np.ndarray, reach_tolerance: float = REACH_TOLERANCE) -> np.ndarray:
        """Every solution, whether within the joint limits or not.

        Where an angle is left open (axes 4 and 6 in line, wrist on axis 1) it is set to zero.

        Args:
            X_WE: poses of the tool, shape (..., 4, 4).
            reach_tolerance: for a pose no farther in m than this beyond the reach, the arm is stretched, or
                folded, towards it.

        Returns:
            Joint positions in (-pi, pi], shape (..., 8, 6), rows of NaN where a branch is out of reach. The
            order of c1, c2, wrist is (+, +, +), (+, +, -), (+, -, +) and so on, the wrist running fastest.
        """
        X = self._X_1W @ np.asarray(X_WE, dtype=float) @ self._X_EH
        rows = np.moveaxis(X, (-2, -1), (0, 1))[..., None]
        x, y, z, _ = rows[:, 3]
        c1, c2, c5 = np.array(_BRANCHES).T
        radius = np.hypot(x, y)
        if self._beside == 0.0:
            q1, missing = np.where(radius > _SINGULAR, np.arctan2(c1 * y, c1 * x), 0.0), 0.0
        else:
            missing = abs(self._beside) - radius
            radius = np.sqrt(np.maximum(radius**2 - self._beside**2, 0.0))
            q1 = np.arctan2(y, x) - np.arctan2(self._beside, c1 * radius)
        l25_squared, direction, area = self._triangle(_ARRAYS, c1 * radius, z)
        l25 = np.sqrt(l25_squared)
        excess = np.maximum(np.maximum(l25 - self._longest, self._shortest - l25), missing)
        root = np.sqrt(np.where(excess > reach_tolerance, np.nan, np.maximum(area, 0.0)))
        q2, q3 = self._upper_arm_and_elbow(_ARRAYS, l25_squared, direction, c2 * root)
        wrist = _wrist_rotation(_ARRAYS, rows, q1, q2 + q3)
        _, (a21, _, _), (a31, _, _) = wrist
        q4 = np.where(np.hypot(a21, a31) > _SINGULAR, np.arctan2(c5 * a21, -c5 * a31), 0.0)
        q5, q6 = _last_two(_ARRAYS, wrist, q4)
        q = np.stack([q1, q2, q3, q4, q5, q6], -1) * self._signs
        return wrap_angle(np.where(np.isnan(q2)[..., None], np.nan, q + self._zeros))

    def nearest(self, X_WE: np.ndarray, q_near: np.ndarray) -> np.ndarray:
        """The solution within the joint limits that is nearest to a configuration, full turns included.

        All joints weigh the same. The result can be of another branch than ``q_near`` if that one leaves
        the reach or the limits: compare it with ``q_near`` where a jump would matter. With axes 4 and 6 in
        line the angle of axis 4 is kept, with the wrist on axis 1 that of axis 1.

        Args:
            X_WE: pose of the tool, shape (4, 4) or without the last row (3, 4).
            q_near: joint positions in rad, shape (6,).

        Returns:
            Joint positions in rad, shape (6,).

        Raises:
            UnreachableError: if no branch reaches the pose.
            JointLimitError: if branches reach it, but none within the joint limits.
            ValueError: if an argument is not finite.
        """
        near = (np.asarray(q_near, dtype=float) - self._zeros).tolist()
        # A sum of squares is finite only if all of its terms are.
        if not (math.isfinite(np.vdot(X_WE, X_WE)) and math.isfinite(sum(near))):
            raise ValueError(f"inverse kinematics: not finite: pose {X_WE.tolist()} or configuration {near}")
        X_1E = self._X_1W[:3, :3] @ X_WE[:3]
        X_1E[:, 3] += self._X_1W[:3, 3]
        X = (X_1E @ self._X_EH).tolist()
        q = self._solve(X, near, *self._branch_of(near))
        if q is not None:
            fitted, squared = self._wrap_into_limits(q, near)
            # Another shoulder turns q1 by pi, less beside axis 1, another wrist q4 by pi, another elbow q3 by
            # this much. No branch can be nearer than a solution closer than half of the smallest of these.
            elbow = 2.0 * abs(q[2] * self._signs[2] - self._angle23 + self._angle35)
            shoulder = math.pi - 2.0 * math.asin(min(1.0, self._share_beside(X)))
            if fitted is not None and squared < 0.25 * min(shoulder, elbow, _TURN - elbow) ** 2:
                return np.array(fitted) + self._zeros
        return np.array(self._nearest_of_all(X, near)) + self._zeros

    def along(self, X_WE: np.ndarray, q_start: np.ndarray) -> np.ndarray:
        """The joint path for a path of the tool: each sample nearest to the one before.

        Args:
            X_WE: poses of the tool, shape (n, 4, 4).
            q_start: configuration in rad that the first sample is to be near, shape (6,).

        Returns:
            Joint positions in rad, shape (n, 6).

        Raises:
            UnreachableError, JointLimitError, ValueError: as `nearest`, with the index of the sample.
        """
        path = np.empty((len(X_WE), NUM_JOINTS))
        q = q_start
        for k, X in enumerate(X_WE):
            try:
                q = path[k] = self.nearest(X, q)
            except ValueError as error:
                raise type(error)(f"sample {k} of {len(X_WE)}: {error}") from error
        return path

    def _share_beside(self, X: list) -> float:
        """How far the plane of the arm is from axis 1, over how far the wrist is."""
        if self._beside == 0.0:
            return 0.0
        return abs(self._beside) / max(math.hypot(X[0][3], X[1][3]), _SINGULAR)

    def _triangle(self, m: Any, x: Any, z: Any) -> tuple[Any, Any, Any]:
        """Joints 2, 3 and the wrist, with the wrist at (x, z) in the plane of the arm, from frame 1.

        Returns:
            l25 squared, the angle of the line 2-5 from z towards x, Probst (2024) eqs. (2.16), (2.20), and
            (4 * area of the triangle)^2 by Heron's formula, negative out of reach.
        """
        x, z = x - self._shoulder_x, z - self._shoulder_z
        l25_squared = x * x + z * z
        area = (self._longest**2 - l25_squared) * (l25_squared - self._shortest**2)
        return l25_squared, m.atan2(x, z), area

    def _upper_arm_and_elbow(self, m: Any, l25_squared: Any, direction: Any, root: Any) -> tuple[Any, Any]:
        """q2 and q3 of Probst (2024) eqs. (2.17), (2.22), where root is c2 times 4 times the area.

        The angles come from sine and cosine, because the arc cosine of the source loses half of the digits
        when the arm is stretched.
        """
        difference = self._l23**2 - self._l35**2
        q2 = direction - self._angle23 - m.atan2(root, l25_squared + difference)
        q3 = self._angle23 - self._angle35 + m.atan2(root, l25_squared - self._l23**2 - self._l35**2)
        return q2, q3

    def _branch_of(self, q: list[float]) -> tuple[float, float, float]:
        """(c1, c2, c5) of a configuration."""
        _, q2, q3, _, q5, _ = (sign * angle for sign, angle in zip(self._signs, q, strict=True))
        upper_arm, forearm = self._angle23 + q2, self._angle35 + q2 + q3
        x = self._shoulder_x + self._l23 * math.sin(upper_arm) + self._l35 * math.sin(forearm)
        return (
            1.0 if x >= 0.0 else -1.0,
            1.0 if math.sin(forearm - upper_arm) >= 0.0 else -1.0,
            1.0 if math.sin(q5) >= 0.0 else -1.0,
        )

    def _solve(self, X: list, near: list[float], c1: float, c2: float, c5: float) -> list[float] | None:
        """One branch for the pose of the wrist, or None out of reach; ``near`` fills in what is open."""
        x, y, z = X[0][3], X[1][3], X[2][3]
        radius = math.hypot(x, y)
        if self._beside == 0.0:
            q1 = math.atan2(c1 * y, c1 * x) if radius > _SINGULAR else self._signs[0] * near[0]
        else:
            if abs(self._beside) - radius > REACH_TOLERANCE:
                return None
            radius = math.sqrt(max(radius * radius - self._beside**2, 0.0))
            q1 = math.atan2(y, x) - math.atan2(self._beside, c1 * radius)
        l25_squared, direction, area = self._triangle(math, c1 * radius, z)
        if area < 0.0:
            if self._excess(math.sqrt(l25_squared)) > REACH_TOLERANCE:
                return None
            area = 0.0
        q2, q3 = self._upper_arm_and_elbow(math, l25_squared, direction, c2 * math.sqrt(area))
        wrist = _wrist_rotation(math, X, q1, q2 + q3)
        a21, a31 = wrist[1][0], wrist[2][0]
        regular = math.hypot(a21, a31) > _SINGULAR
        q4 = math.atan2(c5 * a21, -c5 * a31) if regular else self._signs[3] * near[3]
        q5, q6 = _last_two(math, wrist, q4)
        s1, s2, s3, s4, s5, s6 = self._signs
        return [s1 * q1, s2 * q2, s3 * q3, s4 * q4, s5 * q5, s6 * q6]

    def _wrap_into_limits(self, q: list[float], near: list[float]) -> tuple[list[float] | None, float]:
        """The turns of q nearest to ``near`` within the limits, or None, and the squared distance."""
        fitted, squared = [], 0.0
        for angle, wanted, lower, upper in zip(q, near, self._lower, self._upper, strict=True):
            angle = wanted + math.remainder(angle - wanted, _TURN)
            if not lower <= angle <= upper:
                angle = turned_into(angle, lower, upper)
                if angle is None:
                    return None, math.inf
            fitted.append(angle)
            squared += (angle - wanted) ** 2
        return fitted, squared

    def _nearest_of_all(self, X: list, near: list[float]) -> list[float]:
        solutions = [q for branch in _BRANCHES if (q := self._solve(X, near, *branch)) is not None]
        if not solutions:
            raise UnreachableError(self._reach_message(X))
        best, smallest = None, math.inf
        for q in solutions:
            fitted, squared = self._wrap_into_limits(q, near)
            if fitted is not None and squared < smallest:
                best, smallest = fitted, squared
        if best is None:
            raise JointLimitError(self._limit_message(solutions, near))
        return best

    def _excess(self, l25: float) -> float:
        """How far in m the wrist is out of reach, negative within reach."""
        return max(l25 - self._longest, self._shortest - l25)

    def _reach_message(self, X: list) -> str:
        radius = math.hypot(X[0][3], X[1][3])
        if radius < abs(self._beside) - REACH_TOLERANCE:
            return (
                f"out of reach: the wrist centre would be {1e3 * radius:.1f} mm from axis 1, and the arm "
                f"moves {1e3 * abs(self._beside):.1f} mm beside it"
            )
        radius = math.sqrt(max(radius * radius - self._beside**2, 0.0))
        squares = [self._triangle(math, x, X[2][3])[0] for x in (radius, -radius)]
        l25 = min(map(math.sqrt, squares), key=self._excess)
        where = "far from" if l25 > self._longest else "close to"
        return (
            f"out of reach: the wrist centre would be {1e3 * self._excess(l25):.3f} mm too {where} axis 2, "
            f"allowed are {1e3 * self._shortest:.1f} to {1e3 * self._longest:.1f} mm, got {1e3 * l25:.1f} mm"
        )

    def _limit_message(self, solutions: list[list[float]], near: list[float]) -> str:
        """About the branch that would be nearest if there were no limits."""
        moves = [[math.remainder(a - b, _TURN) for a, b in zip(q, near, strict=True)] for q in solutions]
        closest = min(range(len(moves)), key=lambda k: sum(move * move for move in moves[k]))
        for i, move in enumerate(moves[closest]):
            angle, lower, upper = near[i] + move, self._lower[i], self._upper[i]
            if turned_into(angle, lower, upper) is None:
                break
        angle, lower, upper = (math.degrees(each + self._zeros[i]) for each in (angle, lower, upper))
        return f"joint {i + 1} would be at {angle:.2f} deg, allowed are {lower:g} to {upper:g} deg"


def turned_into(angle: float, lower: float, upper: float) -> float | None:
    """The angle brought within the limits by the fewest full turns, or None if no turn brings it there."""
    if angle > upper + LIMIT_TOLERANCE:
        angle -= _TURN * math.ceil((angle - upper - LIMIT_TOLERANCE) / _TURN)
    elif angle < lower - LIMIT_TOLERANCE:
        angle += _TURN * math.ceil((lower - LIMIT_TOLERANCE - angle) / _TURN)
    if lower - LIMIT_TOLERANCE <= angle <= upper + LIMIT_TOLERANCE:
        return min(max(angle, lower), upper)
    return None


def _wrist_rotation(m: Any, rows: Any, q1: Any, q23: Any) -> tuple[Any, Any, Any]:
    """R_36 of Probst (2024) eq. (2.24) as a11, (a21, a22, a23), (a31, a32, a33); q23 is q2 + q3.

    Frame 6 is parallel to frame 3 at zero joint angles, so the columns are those of the source in another
    order and with other signs.
    """
    (xx, xy, xz, *_), (yx, yy, yz, *_), (zx, zy, zz, *_) = rows[0], rows[1], rows[2]
    s1, c1, s, c = m.sin(q1), m.cos(q1), m.sin(q23), m.cos(q23)
    ax, ay, az = c1 * xx + s1 * yx, c1 * xy + s1 * yy, c1 * xz + s1 * yz
    return (
        c * ax - s * zx,
        (c1 * yx - s1 * xx, c1 * yy - s1 * xy, c1 * yz - s1 * xz),
        (s * ax + c * zx, s * ay + c * zy, s * az + c * zz),
    )


def _last_two(m: Any, wrist: tuple[Any, Any, Any], q4: Any) -> tuple[Any, Any]:
    """q5 of Probst (2024) eq. (2.26), and q6 from what q4 leaves of the rotation.

    Eq. (2.27) is the same away from the singularity; close to it q4 is uncertain, and only a q6 that goes
    with this very q4 keeps the orientation accurate.
    """
    a11, (a21, a22, a23), (a31, a32, a33) = wrist
    s4, c4 = m.sin(q4), m.cos(q4)
    return m.atan2(s4 * a21 - c4 * a31, a11), m.atan2(-c4 * a23 - s4 * a33, c4 * a22 + s4 * a32)

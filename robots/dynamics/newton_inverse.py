"""Numeric inverse kinematics of a calibrated robot, for which the analytic solution is a first guess.

A calibrated robot has axes that do not meet and are not parallel, by tenths of a millimetre and of a degree.
The ideal robot next to it, with the small deviations left out, has an analytic solution; a few Newton steps
lead from there to the exact one. It needs no gain and does not drift.

Near a singularity the two robots differ by much more than their deviations: where the wrist of one is
stretched that of the other is bent, and joint 4 stands elsewhere. Newton's steps fail there, and the method
of Levenberg and Marquardt takes over, from all branches of the ideal robot.
"""

from contextlib import suppress
from dataclasses import replace
from typing import Protocol

import numpy as np
from scipy.optimize import least_squares

from robots.description.model import Joint, Placement, RobotModel
from robots.dynamics.compliant_kinematics import CompliantKinematics
from robots.kinematics.analytic_inverse import InverseKinematics, JointLimitError, UnreachableError
from robots.kinematics.arm_structure import AXES, FREE_OF_OFFSET, has_spherical_wrist, seen_from_base
from robots.kinematics.forward import Kinematics
from robots.kinematics.numeric_inverse import CLOSE, ForwardKinematics, NumericInverse
from robots.pose import zyx_from_rotation

_ACCURATE = 1e-9  # m, or of direction cosines: what a solution may be off
_MOST_EVALUATIONS = 100  # of Levenberg and Marquardt
_LARGEST_TILT = 0.3  # of direction cosines: what still counts as a deviation
_LARGEST_OFFSET = 0.05  # m
_SAMPLES = 64  # configurations at which the ideal robot is compared with the true one


class InverseSolver(Protocol):
    """Inverse kinematics, whichever way they are solved."""

    def nearest(self, X_WE: np.ndarray, q_near: np.ndarray) -> np.ndarray:
        """See `InverseKinematics.nearest`."""
        ...

    def along(self, X_WE: np.ndarray, q_start: np.ndarray) -> np.ndarray:
        """See `InverseKinematics.along`."""
        ...


def inverse_kinematics(robot: RobotModel, payload: float = 0.0) -> InverseSolver:
    """The analytic solution where the robot is built for it, a numeric one where it is not, or yields.

    Args:
        robot: nominal or calibrated.
        payload: mass at the flange in kg, under which a robot with compliances bends.
    """
    yielding = CompliantKinematics(robot, payload) if robot.has_joint_calibration else None
    if yielding is None and has_spherical_wrist(robot):
        return InverseKinematics(robot)
    try:
        return NewtonInverse(robot, yielding)
    except ValueError:  # too far from an ideal robot
        return NumericInverse(robot, yielding)


def ideal_robot(robot: RobotModel) -> RobotModel:
    """The robot next to this one that the analytic inverse kinematics can solve.

    Axes are turned to the nearest coordinate axis of the base, offsets that must not be are left out. All
    frames of the links are parallel to the base at zero joint angles; the joints move as they did.

    Raises:
        ValueError: if a deviation is too large to be an error of a robot of this kind.
    """
    axes, offsets, R_BF = seen_from_base(robot)
    joints = []
    for number, (joint, letter, axis, offset) in enumerate(
        zip(robot.joints, AXES, axes, offsets, strict=True), 1
    ):
        unit = np.eye(3)["xyz".index(letter)]
        unit = unit * np.sign(unit @ axis)
        if np.abs(axis - unit).max() > _LARGEST_TILT:
            raise ValueError(
                f"inverse kinematics of {robot.name}: the axis of joint {number} must nearly point along "
                f"{letter} at zero joint angles, got {np.round(axis, 3).tolist()} in the base"
            )
        offset = offset.copy()
        for forbidden in FREE_OF_OFFSET.get(number, ""):
            k = "xyz".index(forbidden)
            if abs(offset[k]) > _LARGEST_OFFSET:
                raise ValueError(
                    f"inverse kinematics of {robot.name}: joint {number} must have nearly no offset along "
                    f"{forbidden}, got {1e3 * offset[k]:.1f} mm"
                )
            offset[k] = 0.0
        joints.append(Joint(unit, Placement(offset), joint.limits, joint.drive_train))
    X_FE = robot.tool.pose()
    R_BE = R_BF @ X_FE.rotation().matrix()
    tool = Placement(R_BF @ X_FE.translation(), np.rad2deg(zyx_from_rotation(R_BE)))
    return replace(robot, joints=joints, tool=tool)


class NewtonInverse(NumericInverse):
    """Joint positions of a robot next to an ideal one, whose branches are the first guesses."""

    def __init__(self, robot: RobotModel, kinematics: ForwardKinematics | None = None) -> None:
        """Finds the ideal robot.

        Args:
            robot: whose limits count and whose geometry is nearly ideal.
            kinematics: what is inverted; None for the robot's own kinematics.

        Raises:
            ValueError: as `ideal_robot`.
        """
        super().__init__(robot, kinematics)
        self._ideal = InverseKinematics(ideal_robot(robot))
        # A pose so far beyond the reach of the ideal robot may still be within that of the true one.
        q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (_SAMPLES, len(self._lower)))
        apart = self._kinematics.forward(q) - Kinematics(self._ideal.robot).forward(q)
        self._reach_tolerance = 2.0 * float(np.linalg.norm(apart[:, :3, 3], axis=-1).max())

    def nearest(self, X_WE: np.ndarray, q_near: np.ndarray) -> np.ndarray:
        """The solution near a configuration if the pose is near it, or else on the nearest ideal branch.

        Args:
            X_WE: pose of the tool, shape (4, 4) or without the last row (3, 4).
            q_near: joint positions in rad, shape (6,).

        Returns:
            Joint positions in rad, shape (6,).

        Raises:
            UnreachableError, JointLimitError, ValueError: as `InverseKinematics.nearest`.
        """
        if not (np.isfinite(X_WE).all() and np.isfinite(q_near).all()):
            raise ValueError(f"inverse kinematics: not finite: pose {X_WE.tolist()} or {q_near.tolist()}")
        refusal: ValueError = UnreachableError(
            "out of reach: the iteration to the exact inverse does not converge"
        )
        try:
            q = self._newton(X_WE, q_near, CLOSE)
            if q is None:
                q = self._newton(X_WE, self._ideal.nearest(X_WE, q_near), np.inf)
            if q is not None:
                return self._wrap_into_limits(q)
        except (UnreachableError, JointLimitError) as error:
            refusal = error
        q = self._nearest_of_all(X_WE, q_near)
        if q is None:
            raise refusal
        return q

    def _nearest_of_all(self, X_WE: np.ndarray, q_near: np.ndarray) -> np.ndarray | None:
        """The solution within the limits that is nearest to a configuration, from all ideal branches."""
        X_WE = np.vstack([X_WE[:3], [0.0, 0.0, 0.0, 1.0]])
        branches = self._ideal.all_branches(X_WE, self._reach_tolerance)
        starts = branches[~np.isnan(branches).any(axis=1)]
        if not len(starts):
            return None
        # With axes 4 and 6 nearly in line the ideal joint 4 says little about the true one.
        for turn in (0.0, 0.5 * np.pi):
            quarter = np.array([0.0, 0.0, 0.0, turn, 0.0, -turn])
            found = [self._levenberg_marquardt(X_WE, start + quarter) for start in [q_near, *starts]]
            solutions = []
            for q in found:
                if q is not None:
                    with suppress(JointLimitError):
                        solutions.append(self._wrap_into_limits(q))
            if solutions:
                return min(solutions, key=lambda q: float(np.sum((q - q_near) ** 2)))
        return None

    def _levenberg_marquardt(self, X_WE: np.ndarray, q: np.ndarray) -> np.ndarray | None:
        """The solution to which MINPACK's least squares lead from q; None if they lead to none.

        The residuals are the differences of the first three rows of the poses, which have no singularity.
        """

        def residuals(q: np.ndarray) -> np.ndarray:
            return (self._kinematics.forward(q)[:3] - X_WE[:3]).ravel()

        def derivative(q: np.ndarray) -> np.ndarray:
            X, J = self._kinematics.forward_and_jacobian(q)
            rows = np.empty((3, 4, len(q)))
            rows[:, :3] = np.cross(J[:3].T[:, None], X[:3, :3].T[None]).transpose(2, 1, 0)
            rows[:, 3] = J[3:]
            return rows.reshape(12, len(q))

        found = least_squares(
            residuals,
            q,
            jac=derivative,  # pyright: ignore[reportArgumentType]  # scipy's stubs know only its names
            method="lm",
            ftol=1e-15,
            xtol=1e-15,
            gtol=1e-15,
            max_nfev=_MOST_EVALUATIONS,
        )
        return found.x if np.abs(found.fun).max() < _ACCURATE else None

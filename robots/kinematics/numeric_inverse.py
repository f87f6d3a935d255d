"""Numeric inverse kinematics of six revolute axes of any geometry: all branches, or the one that is followed.

A general arm has up to sixteen solutions of a pose. They are found by damped Newton steps from many starts at
once; a solution that few starts lead to says that there may be others which none has led to, so starts are
added until every solution has been found several times (the reasoning of Good and Turing for species not yet
seen). Along a path the branch is followed by Newton steps from the last solution.
"""

import math
from typing import Protocol

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.kinematics.analytic_inverse import JointLimitError, UnreachableError, turned_into
from robots.kinematics.forward import Kinematics, robust_solve
from robots.pose import pose_error, wrap_angle

CLOSE = 0.05  # rad and m; from no farther than this the steps begin where the robot is
_NEAR = 0.5  # rad and m; a branch is followed over steps up to this
_FOLLOWED = 0.5  # rad, by which a joint may move in such a step
_CONVERGED = 1e-10  # rad; a step of this size leaves an error of its square
_MOST_STEPS = 25
_ACCURATE = 1e-9  # m, or rad: what a solution may be off
_LONGEST_STEP = 0.3  # rad, of all joints together
_TURN = 2.0 * math.pi

_STARTS = 256  # at a time
_MOST_STARTS = 4096
_IN_VAIN = 1024  # starts that lead to no solution say that there is none
_FOUND_OFTEN = 4  # times, before a solution counts as easy to find
_ROUNDS = 60  # damped steps from each start
_STRIDE = 1.0  # rad, the longest of them
_THERE = 1e-10  # error that ends the steps
_SAME = (
    1e-4  # rad, of two solutions; nearly double ones are found to the root of the error that ends the steps
)
_MOST_SOLUTIONS = 64  # at a singularity there are infinitely many: no more of them are told apart


class ForwardKinematics(Protocol):
    """What a Newton step needs to know of a robot."""

    def forward(self, q: np.ndarray) -> np.ndarray:
        """Poses (..., 4, 4) at joint positions (..., 6)."""
        ...

    def forward_and_jacobian(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pose (4, 4) and geometric Jacobian (6, 6) at joint positions (6,)."""
        ...


class NumericInverse:
    """Joint positions for poses of a robot's tool in the world."""

    def __init__(self, robot: RobotModel, kinematics: ForwardKinematics | None = None) -> None:
        """Takes a robot.

        Args:
            robot: whose limits count.
            kinematics: what is inverted, which differs little from the robot's own; None for the latter.
        """
        self.robot = robot
        self._rigid = Kinematics(robot)
        self._kinematics = kinematics or self._rigid
        self._lower, self._upper = robot.lower.tolist(), robot.upper.tolist()
        # Metres count as radians at this distance: the length of the arm.
        offsets = [joint.placement.translation for joint in robot.joints[1:]] + [robot.tool.translation]
        self._length = max(float(np.linalg.norm(offsets, axis=1).sum()), 1e-3)

    def all_branches(self, X_WE: np.ndarray) -> np.ndarray:
        """Every solution, whether within the joint limits or not.

        Args:
            X_WE: pose of the tool, shape (4, 4).

        Returns:
            Joint positions in (-pi, pi], shape (n, 6) with n up to 16, sorted; of a singular pose, which has
            infinitely many, some of them.
        """
        from scipy.stats import qmc  # here: half a second that few need

        X_WE = np.asarray(X_WE, dtype=float)
        starts = qmc.Halton(NUM_JOINTS, rng=np.random.default_rng(0))
        solutions, counts = np.empty((0, NUM_JOINTS)), np.empty(0, dtype=int)
        for tried in range(_STARTS, _MOST_STARTS + 1, _STARTS):
            found = self._descend(X_WE, np.pi * (2.0 * starts.random(_STARTS) - 1.0))
            solutions, counts = _counted(solutions, counts, found)
            is_complete = counts.min() >= _FOUND_OFTEN if len(counts) else tried >= _IN_VAIN
            if is_complete or len(counts) >= _MOST_SOLUTIONS:
                break
        exact = [self._newton(X_WE, each, np.inf) for each in solutions]
        if self._kinematics is self._rigid:  # at a singularity further steps gain nothing
            exact = [each if q is None else q for each, q in zip(solutions, exact, strict=True)]
        found = [q for q in exact if q is not None]
        if not found:
            return np.empty((0, NUM_JOINTS))
        q = wrap_angle(np.array(found))
        return q[np.lexsort(np.round(q, 6).T[::-1])]

    def nearest(self, X_WE: np.ndarray, q_near: np.ndarray) -> np.ndarray:
        """The solution to which Newton's steps lead if the pose is near, or else the nearest of all branches.

        Args:
            X_WE: pose of the tool, shape (4, 4) or without the last row (3, 4).
            q_near: joint positions in rad, shape (6,).

        Returns:
            Joint positions in rad within the limits, shape (6,).

        Raises:
            UnreachableError: if no branch reaches the pose.
            JointLimitError: if branches reach it, but none within the joint limits.
            ValueError: if an argument is not finite.
        """
        q_near = np.asarray(q_near, dtype=float)
        if not (np.isfinite(X_WE).all() and np.isfinite(q_near).all()):
            raise ValueError(f"inverse kinematics: not finite: pose {X_WE.tolist()} or {q_near.tolist()}")
        q = self.followed(X_WE, q_near)
        if q is not None:
            return self._wrap_into_limits(q)
        branches = self.all_branches(np.vstack([X_WE[:3], [0.0, 0.0, 0.0, 1.0]]))
        if not len(branches):
            raise UnreachableError("out of reach: no start of the iteration leads to this pose")
        # The nearest without limits comes first, so that a refusal is about that one.
        branches = q_near + wrap_angle(branches - q_near)
        order = np.argsort(np.linalg.norm(branches - q_near, axis=1))
        fitted, refusal = [], None
        for branch in branches[order]:
            try:
                fitted.append(self._wrap_into_limits(branch))
            except JointLimitError as error:
                refusal = refusal or error
        if not fitted:
            assert refusal is not None
            raise refusal
        return min(fitted, key=lambda q: float(np.sum((q - q_near) ** 2)))

    def followed(self, X_WE: np.ndarray, q_near: np.ndarray) -> np.ndarray | None:
        """The solution on the branch of a configuration, whether within the limits or not.

        Args:
            X_WE: pose of the tool, shape (4, 4) or without the last row (3, 4).
            q_near: joint positions in rad, shape (6,), at which the tool is nearly there.

        Returns:
            Joint positions in rad, shape (6,); None if Newton's steps do not lead to any nearby.
        """
        q = self._newton(X_WE, q_near, _NEAR)
        return None if q is None or np.abs(q - q_near).max() > _FOLLOWED else q

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
        path = np.empty((len(X_WE), len(q_start)))
        q = q_start
        for k, X in enumerate(X_WE):
            try:
                q = path[k] = self.nearest(X, q)
            except ValueError as error:
                raise type(error)(f"sample {k} of {len(X_WE)}: {error}") from error
        return path

    def _wrap_into_limits(self, q: np.ndarray) -> np.ndarray:
        """The joint positions within the limits, by full turns where that helps."""
        q = q.copy()
        for i, (angle, lower, upper) in enumerate(zip(q.tolist(), self._lower, self._upper, strict=True)):
            turned = turned_into(angle, lower, upper)
            if turned is None:
                raise JointLimitError(
                    f"joint {i + 1} would be at {math.degrees(angle):.2f} deg, "
                    f"allowed are {math.degrees(lower):g} to {math.degrees(upper):g} deg"
                )
            q[i] = turned
        return q

    def _newton(self, X_WE: np.ndarray, q: np.ndarray, largest_error: float) -> np.ndarray | None:
        """Newton steps from q; None if they begin with a larger error or do not converge."""
        for _ in range(_MOST_STEPS):
            X, J = self._kinematics.forward_and_jacobian(q)
            error = pose_error(X_WE, X)
            if error @ error > largest_error**2:
                return None
            largest_error = np.inf
            step = robust_solve(J, error)
            length = float(np.sqrt(step @ step))
            q = q + step * min(1.0, _LONGEST_STEP / max(length, _LONGEST_STEP))
            if length < _CONVERGED:
                # The damped steps at a singularity are short without being near a solution.
                return q if error @ error < _ACCURATE**2 else None
        return None

    def _descend(self, X_WE: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Where damped Newton steps lead from configurations (n, 6): those that reach the pose, (m, 6).

        The damping is the squared error, which keeps the convergence quadratic; rows of the Jacobian are
        weighted so that metres count as radians.
        """
        weights = np.repeat([1.0, 1.0 / self._length], 3)
        active, reached = q, []
        for _ in range(_ROUNDS):
            X, J = self._rigid.forward_and_jacobian(active)
            e = pose_error(X_WE, X) * weights
            squared = np.sum(e * e, axis=1)
            is_there = squared < _THERE**2
            reached.append(active[is_there])
            active, e, squared, J = active[~is_there], e[~is_there], squared[~is_there], J[~is_there]
            if not len(active):
                break
            J = J * weights[:, None]
            JT = np.swapaxes(J, -1, -2)
            damped = J @ JT + (0.1 * squared + 1e-18)[:, None, None] * np.eye(6)
            step = (JT @ np.linalg.solve(damped, e[..., None]))[..., 0]
            length = np.linalg.norm(step, axis=1, keepdims=True)
            active = active + step * np.minimum(1.0, _STRIDE / np.maximum(length, 1e-12))
        return np.concatenate(reached)


def _counted(solutions: np.ndarray, counts: np.ndarray, found: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Different solutions (n, 6) with how often each was found, after some more (m, 6)."""
    for q in wrap_angle(found):
        apart = np.abs(wrap_angle(solutions - q)).max(axis=1, initial=0.0) if len(solutions) else np.empty(0)
        same = np.flatnonzero(apart < _SAME)
        if len(same):
            counts[same[0]] += 1
        elif len(solutions) < _MOST_SOLUTIONS:
            solutions, counts = np.vstack([solutions, q]), np.append(counts, 1)
    return solutions, counts

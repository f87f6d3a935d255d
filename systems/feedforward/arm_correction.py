"""Which turns of the joints bring the tip of a deformed arm back to where that of a rigid one would be.

Two methods take one step a tick and need no iteration: Reiner (2010), sections 3.6.2 and 3.6.3. Where a pose
is out of the deformed arm's reach, or singular, they leave an error and stay small. The direct one of section
3.6.1 is exact where there is a solution.
"""

import math

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.pose import pose_error
from systems.feedforward.deformed_arm import DeformedArm

# Errors count in units of the reach, a radian as much as this share of it. It is small, so that the tip keeps
# to its path where the wrist is singular.
_ROTATION_WEIGHT = 0.12
_LIMITER_SHARPNESS = 1e5  # 1/rad, s of (3.71): far from its limit an angle loses a ten thousandth
_NEWTON_STEPS = 12  # at most; two or three in a tick
_EXACT = 1e-10  # m
_FAR = 0.05  # rad, ten times what a robot yields
_SHORT_LEVER = 0.1  # of the reach, 1 / sqrt(s_phi) of (3.59)


class SigmoidDamping:
    """Damping that falls smoothly as a singular value grows, Reiner (2010) eq. (3.66)."""

    def __init__(
        self,
        largest: float,
        smallest: float,
        bounds: tuple[float, float],
        factors: tuple[float, float] = (0.9, 1.1),
    ) -> None:
        """Solves (3.67) for the steepness and the middle of the sigmoid.

        Args:
            largest: upper limit of the damping.
            smallest: its lower limit.
            bounds: singular values between which the damping falls.
            factors: what it is there, of the upper and of the lower limit.

        Raises:
            ValueError: if these numbers are not in the order of (3.67c).
        """
        high, low = factors[0] * largest, factors[1] * smallest
        if not (0.0 < smallest < low < high < largest and 0.0 < bounds[0] < bounds[1]):
            raise ValueError(
                f"damping: must fall from largest to smallest between two bounds in their order, "
                f"got {largest}, {smallest} and {bounds}, with {high} and {low} at the bounds"
            )
        span = largest - smallest
        # exp(-s (sigma - middle)) at the two bounds.
        first, second = (math.log(span / (largest - value) - 1.0) for value in (high, low))
        self._steepness = (first - second) / (bounds[1] - bounds[0])
        self._middle = bounds[0] + first / self._steepness
        self._largest, self._span = largest, span

    def at(self, singular_value: np.ndarray | float) -> np.ndarray:
        """Damping at singular values of any shape."""
        excess = np.minimum(-self._steepness * (singular_value - self._middle), 700.0)
        return self._largest - self._span / (1.0 + np.exp(excess))


class LeastSquaresCorrection:
    """Damped least squares for the whole pose, Reiner (2010) eqs. (3.85), (3.86).

    Linearised about the last correction, it is exact as far as corrections change little in a tick; damped is
    the whole correction and not its change, so that nothing drifts where the arm is singular. The damping
    (3.66) belongs to each singular value by itself, so that only the lost direction stays uncorrected.

    Axes 1 and 3 have a damping of their own, by how far the wrist is from axis 1 and by how far the elbow is
    bent. Robots move their wrist past axis 1 and stretch their arm, and what these levers ask for when they
    are short would turn about within a few ticks. A correction that fades out within some hundredths of a
    second still shakes the arm: where a fast motion takes the wrist past axis 1, none at all may ring less.
    To fade out further from that axis costs the motions beside it more.
    """

    def __init__(self, robot: RobotModel, arm: DeformedArm) -> None:
        """Sets the weights by the size of the robot."""
        self._arm, self._reach = arm, reach(robot)
        self._damping = SigmoidDamping(0.04, 1e-5, (0.012, 0.045))
        self._shoulder_damping = SigmoidDamping(0.15, 1e-5, (0.14, 0.5))
        self._elbow_damping = SigmoidDamping(0.05, 1e-5, (0.15, 0.5))
        self._weights = np.repeat([_ROTATION_WEIGHT, 1.0 / self._reach], 3)

    def correction(
        self, q: np.ndarray, deflection: np.ndarray, X_WE: np.ndarray, last: np.ndarray
    ) -> np.ndarray:
        """Turns of the joints in rad, shape (6,).

        Args:
            q: positions of the rigid arm in rad, shape (6,).
            deflection: of the structure in rad.
            X_WE: where the tip shall be, shape (3, 4).
            last: correction at the last tick.
        """
        X, J = self._arm.pose_and_jacobian(q + last, deflection)
        lever, bend = self._arm.posture()
        turns, wanted = np.zeros((NUM_JOINTS + 2, NUM_JOINTS)), np.zeros(NUM_JOINTS + 2)
        turns[:NUM_JOINTS] = self._weights[:, None] * J
        turns[NUM_JOINTS, 0] = self._shoulder_damping.at(lever / self._reach)
        turns[NUM_JOINTS + 1, 2] = self._elbow_damping.at(bend)
        wanted[:NUM_JOINTS] = self._weights * (pose_error(X_WE, X) + J @ last)
        U, s, Vt = np.linalg.svd(turns, full_matrices=False)
        gain = s / (s * s + self._damping.at(s) ** 2)
        return (gain * (wanted @ U)) @ Vt


class GeometricCorrection:
    """Axis 2 puts axis 3 in its place, axes 3 and 1 the tip, Reiner (2010) section 3.6.2.

    Each turn takes a lever of the deformed arm to where the lever of the rigid arm points. Three forward
    kinematics, no Jacobian; the orientation is left as it is. Short levers turn less, as by (3.59), but
    smoothly also where they vanish.
    """

    def __init__(self, robot: RobotModel, arm: DeformedArm) -> None:
        """Sets what lever is short by the size of the robot."""
        self._arm, self._short = arm, _SHORT_LEVER * reach(robot)

    def correction(
        self, q: np.ndarray, deflection: np.ndarray, X_WE: np.ndarray, last: np.ndarray
    ) -> np.ndarray:
        """Turns of the joints in rad; see `LeastSquaresCorrection.correction`, but ``last`` is not used."""
        elbow = self._arm.rigid_elbow(q)
        turns = np.zeros(NUM_JOINTS)
        for joint, target in ((1, elbow), (2, X_WE[:, 3]), (0, X_WE[:, 3])):
            axis, pivot, reached_elbow, tip = self._arm.lever(joint, q + turns, deflection)
            turns[joint] = self._turn(axis, (reached_elbow if joint == 1 else tip) - pivot, target - pivot)
        return turns

    def _turn(self, axis: np.ndarray, lever: np.ndarray, target: np.ndarray) -> float:
        """The angle about an axis from one lever to another, both seen along the axis."""
        lever = lever - (lever @ axis) * axis
        target = target - (target @ axis) * axis
        # A factor on the angle, as in (3.59), would leave its jump by 2 pi where the two point apart.
        short = self._short**2 * math.exp(-float(lever @ lever) / self._short**2)
        return math.atan2(float(axis @ np.cross(lever, target)), float(lever @ target) + short)


class DirectCorrection:
    """Axes 1, 2 and 3 put the tip exactly in its place, without damping; Reiner (2010) section 3.6.1.

    The equations of the deformed arm, solved by Newton's method from the last correction. Where there is no
    solution, or only one that turns a joint far, the last correction stays, and it jumps when there is one
    again: for paths that keep away from such poses. The orientation is left as it is.
    """

    def __init__(self, robot: RobotModel, arm: DeformedArm) -> None:
        """Takes the arm; the robot has nothing to set."""
        self._arm = arm

    def correction(
        self, q: np.ndarray, deflection: np.ndarray, X_WE: np.ndarray, last: np.ndarray
    ) -> np.ndarray:
        """Turns of the joints in rad; see `LeastSquaresCorrection.correction`."""
        turns = last.copy()
        for _ in range(_NEWTON_STEPS):
            X, J = self._arm.pose_and_jacobian(q + turns, deflection)
            missing = X_WE[:, 3] - X[:, 3]
            if math.sqrt(float(missing @ missing)) < _EXACT:
                return turns
            step = np.linalg.lstsq(J[3:, :3], missing, rcond=None)[0]
            turns[:3] += step
            if np.abs(turns).max() > _FAR:
                break
        return last


CORRECTIONS = {
    "least_squares": LeastSquaresCorrection,
    "geometric": GeometricCorrection,
    "direct": DirectCorrection,
}


def smoothly_limited(angle: np.ndarray, limit: float, sharpness: float = _LIMITER_SHARPNESS) -> np.ndarray:
    """Angles that never go far beyond +-limit, Reiner (2010) eq. (3.71), corrected.

    Args:
        angle: in rad, any shape.
        limit: in rad.
        sharpness: in 1/rad; the limit is passed by less than twice its inverse.
    """
    above = np.arctan((angle - limit) * sharpness) / np.pi + 0.5
    below = 0.5 - np.arctan((angle + limit) * sharpness) / np.pi
    return angle - angle * (above + below) + limit * (above - below)


def reach(robot: RobotModel) -> float:
    """The length in m of the arm from axis 2 to the tip, stretched."""
    offsets = [joint.placement.translation for joint in robot.joints[2:]]
    return float(sum(np.linalg.norm(offset) for offset in [*offsets, robot.tool.translation]))

"""How far the joints may go until the next command: range, speed, acceleration, and room to brake in."""

import math

import numpy as np

from robots.description.model import RobotModel

_ROUNDING, _SMALLEST = 1e-9, 1e-14  # relative, and rad: what is judged here has been computed by others


class JointLimits:
    """Limits of all joints, for steps from one command to the next.

    A joint's motion is told by its mean speeds between commands. From one to the next such a speed may change
    by the acceleration times the time between the middles of the two intervals. So that a joint can always
    stop before the end of its range, its speed is bounded by what can be braked away in the way left,
    whenever the commands after this one come.
    """

    def __init__(self, robot: RobotModel, speed_share: float = 1.0) -> None:
        """Takes the limits of a robot.

        Args:
            robot: whose.
            speed_share: of its largest speeds that is allowed.
        """
        self.lower, self.upper = robot.lower, robot.upper
        self.speed, self.acceleration = speed_share * robot.speed, robot.acceleration
        jerk = np.deg2rad([joint.limits.jerk_deg_s3 for joint in robot.joints])
        self.jerk = np.where(jerk > 0.0, jerk, np.inf)

    def step(
        self,
        position: np.ndarray,
        speed: np.ndarray,
        goal: np.ndarray,
        rate: np.ndarray,
        period: float,
        span: float | None = None,
    ) -> tuple[np.ndarray, float]:
        """The mean speeds (6,) in rad/s until the next command, on the way to a goal that moves.

        Joints that must be slowed down are slowed down together, so that from rest to a goal that stands the
        way is straight. The last word has `bounded`.

        Args:
            position: commanded last, (6,) rad.
            speed: mean speeds until then, (6,) rad/s.
            goal: (6,) rad.
            rate: speeds of the goal, (6,) rad/s.
            period: time until the next command in s.
            span: between the middles of the last interval and this one in s, by default the period.

        Returns:
            The speeds, and by how many times the goal would have been faster than the joints may be.
        """
        span = period if span is None else span
        change = self.acceleration * span
        inside = np.minimum(np.maximum(goal, self.lower), self.upper)
        rate = np.where((goal - inside) * rate > 0.0, 0.0, rate)  # no further out
        off = inside - position - rate * period
        distance = np.abs(off)
        # Along the straight line, as fast as the joint that has to brake first can still brake.
        slope = fastest(distance, change, period) / np.maximum(distance, 1e-300)
        wanted = rate + min(1.0 / period, float(slope[distance > 0.0].min(initial=math.inf))) * off
        excess = float((np.abs(wanted) / self.speed).max())
        if excess > 1.0:
            wanted = wanted / excess
        turn = wanted - speed
        share = float((np.abs(turn) / np.maximum(change, 1e-300)).max())
        if share > 1.0:
            wanted = speed + turn / share
        return self.bounded(position, speed, wanted, period, span), excess

    def bounded(
        self, position: np.ndarray, speed: np.ndarray, wanted: np.ndarray, period: float, span: float
    ) -> np.ndarray:
        """The allowed speeds nearest to those that are wanted, joint by joint; arguments as of `step`."""
        change = self.acceleration * span
        up = stoppable(self.upper - position, self.acceleration, period)
        down = -stoppable(position - self.lower, self.acceleration, period)
        low, high = speed - change, speed + change
        wanted = np.minimum(np.maximum(wanted, np.maximum(down, -self.speed)), np.minimum(up, self.speed))
        return np.minimum(np.maximum(wanted, low), high)

    def moved(self, position: np.ndarray, speed: np.ndarray, period: float) -> np.ndarray:
        """Where the joints are commanded after a step (6,) in rad; never out of their range."""
        low, high = np.minimum(self.lower, position), np.maximum(self.upper, position)
        return np.minimum(np.maximum(position + speed * period, low), high)

    def rows(self, period: float) -> np.ndarray:
        """Of each joint lower and upper limit, speed, step, change of speed and change of step, (6, 6).

        They are what `systems.guard.kernels.is_allowed` asks for.
        """
        grown = 1.0 + _ROUNDING
        stride, change = grown * period * self.speed, grown * period * self.acceleration
        columns = (self.lower, self.upper, grown * self.speed, stride, change, period * change + _SMALLEST)
        return np.stack(columns, axis=1)


def stoppable(distance: np.ndarray, acceleration: np.ndarray, period: float) -> np.ndarray:
    """The largest speeds (rad/s) until the next command from which joints stop within distances (rad).

    A mean speed v until then stands for v - a h / 2 at its end, h being the period and a the acceleration.
    Braked with a from there, mean speeds cover v h + (v - a h / 2)^2 / 2 a in all, whatever the steps are.
    """
    distance, half = np.maximum(distance, 0.0), 0.5 * period * acceleration
    braking = np.sqrt(2.0 * acceleration * distance)
    return np.where(braking > 2.0 * half, braking - half, distance / period)


def fastest(distance: np.ndarray, change: np.ndarray, period: float) -> np.ndarray:
    """The largest speeds (rad/s) from which joints stop within distances (rad), exactly, in steps.

    With a speed of (n + r) changes, 0 <= r < 1, the steps left add up to n (n + 1) / 2 + (n + 1) r changes
    times the period.
    """
    far = np.maximum(distance, 0.0) / np.maximum(change * period, 1e-300)
    n = np.floor(0.5 * (np.sqrt(1.0 + 8.0 * far) - 1.0))
    return (n + (far - 0.5 * n * (n + 1.0)) / (n + 1.0)) * change

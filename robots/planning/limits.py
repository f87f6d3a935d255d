"""What a motion must keep to: limits of joints, motors, gears and of the tool."""

from dataclasses import dataclass, field, fields, replace

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel

# Of each joint, in the order of figures: name, unit and what people call it.
JOINT_LIMITS = {
    "speed": ("rad/s", "speed"),
    "acceleration": ("rad/s^2", "acceleration"),
    "jerk": ("rad/s^3", "jerk"),
    "motor_torque": ("N m", "motor torque"),
    "continuous_torque": ("N m", "motor torque, root mean square"),
    "gear_torque": ("N m", "gear torque"),
    "gear_torque_rate": ("N m/s", "rate of gear torque"),
}

OVER_TIME = tuple(name for name in JOINT_LIMITS if name != "continuous_torque")
_OF_MOTORS = ("speed", "acceleration", "jerk", "motor_torque")
RESERVE = 0.1  # of them, for a law: what its corrections take on top of a motion

DUTY = 0.6  # of a cycle that is motion, as in the rating S3 60 %; in between brakes hold the arm


@dataclass(frozen=True)
class MotionLimits:
    """Largest magnitudes, infinite where nothing is known; joints in shape (6,), torques behind the gear."""

    speed: np.ndarray  # rad/s, of the motors seen behind the gear
    acceleration: np.ndarray  # rad/s^2, of the links
    jerk: np.ndarray  # rad/s^3, of the links
    motor_torque: np.ndarray  # N m
    continuous_torque: np.ndarray  # N m, root mean square over the motion: how warm motors get
    gear_torque: np.ndarray  # N m
    gear_torque_rate: np.ndarray  # N m/s
    tool_speed: float = np.inf  # m/s
    tool_acceleration: float = np.inf  # m/s^2
    # What a planner may use of `OVER_TIME` at times of a motion: shares at k even times of its duration
    shares: np.ndarray = field(default_factory=lambda: np.ones((2, len(OVER_TIME), NUM_JOINTS)))

    @property
    def unlimited_torques(self) -> list[str]:
        """What people call the torques of which no joint has a limit: a motion may take what no motor has."""
        torques = "motor_torque", "gear_torque", "gear_torque_rate"
        return [JOINT_LIMITS[name][1] for name in torques if np.isinf(getattr(self, name)).all()]

    def scaled(self, share: float) -> "MotionLimits":
        """All of them times a share."""
        names = [each.name for each in fields(self) if each.name != "shares"]
        return replace(self, **{name: share * getattr(self, name) for name in names})

    def shares_at(self, x: np.ndarray) -> np.ndarray:
        """The shares that may be used at shares of the duration (m,), shape (m, limits, 6)."""
        even = np.linspace(0.0, 1.0, len(self.shares))
        columns = [np.interp(x, even, each) for each in self.shares.reshape(len(even), -1).T]
        return np.array(columns).T.reshape(len(x), *self.shares.shape[1:])

    def with_reserve(self, share: float) -> "MotionLimits":
        """What is left where a law that corrects the motion needs a share of what motors can.

        Raises:
            ValueError: if it is no share.
        """
        if not 0.0 <= share < 1.0:
            raise ValueError(f"--reserve must be at least 0 and below 1, got {share:g}")
        return replace(self, **{name: (1.0 - share) * getattr(self, name) for name in _OF_MOTORS})


def motion_limits(
    robot: RobotModel,
    tool_speed: float = np.inf,
    tool_acceleration: float = np.inf,
    duty: float = DUTY,
) -> MotionLimits:
    """The limits of a robot file, with those of the tool.

    Args:
        robot: whose limits.
        tool_speed: m/s.
        tool_acceleration: m/s^2.
        duty: share of a cycle that is motion, over which the motors' torque is averaged.

    Raises:
        ValueError: if a limit of the tool is not positive, or the duty is no share.
    """
    if not 0.0 < duty <= 1.0:
        raise ValueError(f"planning: the duty must be above 0 and at most 1, got {duty}")
    for name, value in (("speed", tool_speed), ("acceleration", tool_acceleration)):
        if not value > 0.0:
            raise ValueError(f"planning: the {name} of the tool must be positive, got {value}")
    ratio = robot.gear_ratio
    jerk = np.deg2rad([joint.limits.jerk_deg_s3 for joint in robot.joints])
    return MotionLimits(
        speed=robot.speed,
        acceleration=robot.acceleration,
        jerk=np.where(jerk > 0.0, jerk, np.inf),
        motor_torque=ratio * _known(robot, "motor_torque"),
        continuous_torque=ratio * _known(robot, "continuous_torque") / np.sqrt(duty),
        gear_torque=_known(robot, "gear_torque"),
        gear_torque_rate=_known(robot, "gear_torque_rate"),
        tool_speed=tool_speed,
        tool_acceleration=tool_acceleration,
    )


def _known(robot: RobotModel, name: str) -> np.ndarray:
    values = [getattr(joint.drive_limits, name, None) for joint in robot.joints]
    return np.array([np.inf if value is None else value for value in values])

"""Which motions are recorded, and by which sensors: the file of ``--motions``, and what stands in for it."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from robots.configuration.nodes import read_nodes
from robots.configuration.quantity import numbers, positive, quantity
from robots.configuration.typed import typed
from robots.description.model import NUM_JOINTS, RobotModel
from systems.cell.inertial_sensors import InertialLoggerConfig, InertialSensorConfig

# Axes 2 and 3 as shares of their ranges, axes 4 to 6 in degrees: stretched and folded, with wrists that give
# the load a lever about each axis.
_POSITIONS = (
    (0.37, 0.76, 0, 0, 0),
    (0.81, 0.55, 0, 60, 0),
    (0.59, 0.44, 0, -60, 0),
    (0.89, 0.80, 90, 45, 0),
    (0.22, 0.58, 0, 90, 90),
    (0.67, 0.87, -60, -45, 0),
    (0.37, 0.44, 45, 75, 45),
    (0.15, 0.87, 0, 30, 0),
    (0.74, 0.65, 90, -80, 0),
)
_GYRO, _ACCELEROMETER = 2e-3, 5e-2  # rad/s, m/s^2: noise of a sample of a good MEMS sensor


@dataclass
class FurtherMotion:
    """One motion beside those of all positions and angles."""

    position_deg: list[float] = numbers((0.0,) * NUM_JOINTS, (NUM_JOINTS,), unit="deg")  # where it begins
    angle_deg: float = 5.0  # by which axes 1 to 3 turn, with its sign
    payload: float | None = quantity(None, 0.0, unit="kg")  # None for that of the other motions


@dataclass(frozen=True)
class PlannedMotion:
    """A motion of axes 1 to 3."""

    start: np.ndarray  # (6,) rad
    angle: float  # rad, signed
    payload: float | None = None  # kg; None for that of the other motions


@dataclass
class MotionCases:
    """Short motions of axes 1 to 3 from several positions, as Reiner (2010), section 4.5.1, and sensors."""

    payload: float | None = quantity(None, 0.0, unit="kg")  # None for the largest
    # s, from rest to the largest speed with the mean acceleration of the motions
    speeding_up: float = positive(0.5, "s")
    settle: float = positive(0.1, "s")  # at rest before
    ringing: float = positive(0.6, "s")  # after the motion
    angles_deg: list[float] = numbers((5.0, 20.0), unit="deg")
    positions_deg: list[list[float]] = field(default_factory=list)  # where motions begin; empty: chosen
    further: list[FurtherMotion] = field(default_factory=list)  # such as an identification has advised
    logger: InertialLoggerConfig = field(default_factory=InertialLoggerConfig)

    def planned(self, robot: RobotModel) -> list[PlannedMotion]:
        """All motions: those of `starts`, then the further ones.

        Raises:
            ValueError: as `starts`, if a further motion is none or leaves the range of a joint, or if there
                is no motion at all.
        """
        found = [PlannedMotion(q, angle) for q, angle in self.starts(robot)]
        for number, each in enumerate(self.further):
            if each.angle_deg == 0.0:
                raise ValueError(f"further[{number}]: an angle of 0 degrees is no motion")
            q, angle = np.deg2rad(each.position_deg), float(np.deg2rad(each.angle_deg))
            if not has_room(robot, q, angle):
                raise ValueError(
                    f"further[{number}]: no room for {each.angle_deg:g} degrees from {each.position_deg}"
                )
            found.append(PlannedMotion(q, angle, each.payload))
        if not found:
            raise ValueError("there is no motion: angles_deg, or further, must have one")
        return found

    def starts(self, robot: RobotModel) -> list[tuple[np.ndarray, float]]:
        """Positions (rad, shape (6,)) and angles (rad, signed) of all cases.

        An angle that would leave the range of a joint is turned the other way.

        Raises:
            ValueError: if a position is not six numbers, an angle is 0, or there is no room for a motion.
        """
        positions = [np.deg2rad(each) for each in self.positions_deg] or _chosen(robot)
        if not all(self.angles_deg):
            raise ValueError("cases: an angle of 0 degrees is no motion")
        found = []
        for q in positions:
            if q.shape != (NUM_JOINTS,):
                raise ValueError(f"cases: a position needs {NUM_JOINTS} angles, got {np.rad2deg(q).tolist()}")
            for angle in np.deg2rad(self.angles_deg):
                turned = [sign * angle for sign in (1.0, -1.0) if has_room(robot, q, sign * angle)]
                if not turned:
                    raise ValueError(
                        f"cases: no room for {np.rad2deg(angle):g} degrees from "
                        f"{np.rad2deg(q).round(1).tolist()}"
                    )
                found.append((q, turned[0]))
        return found


def load_cases(path: Path, robot: RobotModel) -> MotionCases:
    """Reads a file. Raises ConfigurationError, with file and line, if it is missing or wrong."""
    node = read_nodes(path, f"--motions {path}")
    cases = typed(node, MotionCases)
    try:
        cases.planned(robot)
    except ValueError as error:
        raise node.refuse(str(error)) from error
    return _with_sensors(cases, robot)


def default_cases(robot: RobotModel) -> MotionCases:
    """18 cases: nine positions, 5 and 20 degrees; gyros on all links, accelerometers on hand and flange."""
    return _with_sensors(MotionCases(), robot)


def _with_sensors(cases: MotionCases, robot: RobotModel) -> MotionCases:
    if not cases.logger.sensors:
        cases.logger.sensors = _sensors(robot)
        cases.logger.clock_offset, cases.logger.clock_drift_ppm = 0.0123, 20.0
    return cases


def bodies_of(robot: RobotModel) -> list[str]:
    """On which sensors may sit: links, and the ends of those that are beams."""
    bodies = []
    for number, link in enumerate(robot.links, 1):
        bodies.append(f"link_{number}")
        if link.beam is not None:
            bodies.append(f"link_{number}_segment_{4 if link.beam.degrees_of_freedom == 5 else 2}")
    return bodies


def _sensors(robot: RobotModel) -> list[InertialSensorConfig]:
    bodies = bodies_of(robot)
    gyros = [
        InertialSensorConfig(f"gyro_{body}", "gyro", body, range=10.0, noise_sigma=_GYRO) for body in bodies
    ]
    return gyros + [
        InertialSensorConfig(
            f"acc_{body}",
            "accelerometer",
            body,
            [0.0, 0.0, 0.05 * flange],
            range=160.0,
            noise_sigma=_ACCELEROMETER,
        )
        for flange, body in enumerate(("link_5", "link_6"))
    ]


def _chosen(robot: RobotModel) -> list[np.ndarray]:
    lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    found = []
    for share_2, share_3, *wrist_deg in _POSITIONS:
        q = np.zeros(NUM_JOINTS)
        q[1:3] = lower[1:3] + np.array([share_2, share_3]) * (upper - lower)[1:3]
        q[3:] = np.deg2rad(wrist_deg)
        found.append(np.clip(q, lower, upper))
    return found


def has_room(robot: RobotModel, q: np.ndarray, angle: float) -> bool:
    """Whether axes 1 to 3 may turn by an angle from a position, both in rad, within their ranges."""
    end = q.copy()
    end[:3] += angle
    return bool((end > robot.lower).all() and (end < robot.upper).all())

"""One recorded motion in the full nonlinear simulation, with the motors as measured or under its commands."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from diagrams.scenario.scenario import StationConfig
from experiments.cli.workers import Progress
from experiments.identify.simulated import driven
from robots.description.model import NUM_JOINTS, RobotModel
from robots.identification.motion import MotionCase, SensorPlace
from robots.pose import zyx_from_rotation
from systems.cell.drive import CascadeGains, DriveConfig
from systems.cell.inertial_sensors import InertialLoggerConfig, InertialSensorConfig

# kg m^2 on the side of the links: rotors that nothing which happens behind the gears moves from their way.
_HEAVY = 1e6
_FINE = 1e-3  # s: so often sensors are sampled and motors are led, where a case has longer steps
_STIFF = CascadeGains(150.0, 600.0, 0.0)  # their controllers: two poles at 300 per second


@dataclass(frozen=True)
class DrivenBy:
    """Commands of a recording."""

    told: np.ndarray  # (ticks, 3, 6) rad, rad/s, N m
    period: float  # s
    drive: DriveConfig


@dataclass(frozen=True)
class FullRun:
    """A robot that makes a motion which was recorded."""

    robot: RobotModel
    payload: float  # kg
    case: MotionCase
    sensors: list[SensorPlace]
    by: DrivenBy | None = None  # None for motors that move as measured

    def run(self, progress: Progress | None = None) -> "FullReadings":
        """Simulates it.

        Raises:
            SimulationError: if the integration breaks off.
        """
        case, by, robot = self.case, self.by, self.robot
        every = max(1, round(case.period / _FINE))  # of the samples of the sensors one is of the case
        if by is None:
            robot, by = with_heavy_rotors(robot), as_measured(case, case.period / every)
        config = StationConfig(period=by.period, elasticity="structure", payload=self.payload, drive=by.drive)
        end = float(case.times[-1])
        logger = _logger(self.sensors, case.period / every)
        log = driven(case.name, robot, config, by.told, logger, end, 0)
        if progress:
            progress(1.0)
        n = len(case.theta)
        readings = log.samples[::every, 1:].reshape(-1, len(self.sensors), 3)
        kept = np.minimum(np.arange(n), len(readings) - 1)  # the last sample is logged a tick later
        theta = CubicSpline(log.time, log.motor[:, :NUM_JOINTS])(case.times)
        return FullReadings(readings[kept], theta)


@dataclass(frozen=True)
class FullReadings:
    """What sensors show and where motors are, at the samples of a case."""

    readings: np.ndarray  # (n, sensors, 3) rad/s or m/s^2
    theta: np.ndarray  # (n, 6) rad


def with_heavy_rotors(robot: RobotModel) -> RobotModel:
    """The robot with rotors that keep to their way, without what is before the gears: friction and lag."""
    joints = []
    for joint in robot.joints:
        train = joint.drive_train
        train = replace(
            train,
            rotor_inertia=_HEAVY / train.ratio**2,
            viscous_friction=0.0,
            coulomb_friction=0.0,
            friction=None,
            motor_lag=0.0,
        )
        joints.append(replace(joint, drive_train=train))
    return replace(robot, joints=joints)


def as_measured(case: MotionCase, period: float) -> DrivenBy:
    """Commands, one a period in s, that lead heavy rotors along the measured motion."""
    delay = period  # a command is interpolated over a period
    measured = CubicHermiteSpline(case.times, case.theta, case.rate)
    times = np.append(np.arange(1, round(case.times[-1] / period) + 1) * period, case.times[-1])
    theta, rate = measured(times), measured(times, 1)
    # What is told now is held from one period later on for as long: the mean acceleration of that time.
    further = np.concatenate([rate[1:], rate[-1:]])
    torque = _HEAVY * (further - rate) / period
    drive = DriveConfig(cascade=_STIFF, command_delay=delay)
    return DrivenBy(np.stack([theta, rate, torque], axis=1), period, drive)


def _logger(sensors: list[SensorPlace], period: float) -> InertialLoggerConfig:
    return InertialLoggerConfig(
        [
            InertialSensorConfig(
                f"{number} {place.name}",
                place.kind,
                place.body,
                place.position.tolist(),
                np.rad2deg(zyx_from_rotation(place.rotation)).tolist(),
                bandwidth=place.bandwidth,
            )
            for number, place in enumerate(sensors)
        ],
        period,
    )

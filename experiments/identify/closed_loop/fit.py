"""Drives, friction and dampers from motions in closed loop: the fourth stage of Reiner (2010), 4.2.2.

Commands go through the drives to the motors and the arm behind them. What is compared is what every drive
records: where its motor is, and the torque that it is told to give. Springs and parts of gears stay as the
motions with prescribed motors have shown them, dampers begin with what these say and how sure it is.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from experiments.identify.closed_loop.replay import DriveReplay, Led
from robots.description import drive_parts
from robots.description.model import NUM_JOINTS, RobotModel
from robots.identification.arm_fit import ArmFit, part_of, scatter
from robots.identification.closed_loop.driven_arm import DrivenArm, DrivenCase, DriveTorques
from robots.identification.identified_robot import identified_robot
from robots.identification.motion import MotionCase
from robots.threads import side_by_side
from systems.cell.drive import CascadeGains, DriveConfig

GAINS = ("position", "velocity", "integral")
FRICTION = ("viscous", "coulomb")
_MS = 1e-3
# Standard deviations of what is believed: logarithms of gains and friction, delay and lag in ms. A hump stays
# the share of Coulomb's friction that is believed: motions that pass it in milliseconds hardly show it.
_GAIN, _DELAY, _LAG, _FRICTION = 0.5, 2.0, 2.0, 0.7
# Steps of the fit, between which the equations are brought near to what moves, and residuals weighed again.
_ROUNDS = 7, 4
_NEAR = 1e-4  # relative
_DIFFERENCE = 1e-2  # of the derivatives, standard deviations of what is believed
_ORIGIN = 3.0  # scipy's first step is as long as the vector that it begins with
_FLOOR = 5e-4  # of the largest speed and torque of a joint, below which residuals do not scatter
_MAD = 1.4826
_PHASES = 4  # of a case, whose residuals may be wrong by another thing each
_FAR = 1e6  # of the spread, what runs away


@dataclass(frozen=True)
class RecordedDrive:
    """One motion with what the drives were told; n samples."""

    case: MotionCase
    torque: np.ndarray  # (n, 6) N m, what the motors were told to give
    commands: np.ndarray  # (n, 3, 6), positions, velocities, torques, as they were in force


@dataclass(frozen=True)
class DriveFit:
    """What was found, k unknowns."""

    names: list[str]
    values: np.ndarray  # (k,), see `meaning`
    covariance: np.ndarray  # (k, k)
    believed: np.ndarray  # (k,)
    spread: np.ndarray  # (12,) of speeds of the motors in rad/s and of torques in N m, behind the fit
    before: np.ndarray  # (12,) the same with what was believed
    evaluations: int

    @property
    def sigma(self) -> np.ndarray:
        """Standard deviations, (k,)."""
        return np.sqrt(np.diagonal(self.covariance))


class DriveUnknowns:
    """The unknowns of the closed loop as a vector: what they mean and what is believed of them."""

    def __init__(self, robot: RobotModel, fit: ArmFit, config: DriveConfig, period: float) -> None:
        """Takes beliefs.

        Args:
            robot: whose friction and lags are believed.
            fit: of the arm.
            config: of the drives.
            period: of the commands in s.
        """
        self._fit, self._config, self._period = fit, config, period
        trains = [joint.drive_train for joint in robot.joints]
        self._frictions = self.believed_frictions(robot)
        self._times = fit.parameters.of_kind("time")
        joints = range(1, NUM_JOINTS + 1)
        self.names = [*GAINS, "delay", "lag", *(f"{kind}_{i}" for kind in FRICTION for i in joints)]
        self.names += [fit.parameters.names[i] for i in self._times]
        self._lag = float(np.mean([train.motor_lag for train in trains]))
        begin = [0.0, 0.0, 0.0, (config.command_delay + config.dead_time) / _MS, self._lag / _MS]
        self.mean = np.array([*begin, *[0.0] * 2 * NUM_JOINTS, *fit.values[self._times]])
        known = [*[_GAIN] * 3, _DELAY, _LAG, *[_FRICTION] * 2 * NUM_JOINTS]
        self.prior = np.diag(np.square([*known, *[0.0] * len(self._times)]))
        self.prior[len(known) :, len(known) :] = fit.covariance[np.ix_(self._times, self._times)]

    def drive(self, p: np.ndarray) -> DriveConfig:
        """Gains and delay."""
        gains = CascadeGains(
            *(float(getattr(self._config.cascade, name) * np.exp(p[i])) for i, name in enumerate(GAINS))
        )
        delay = max(float(p[3]) * _MS, self._period)
        return replace(self._config, cascade=gains, command_delay=delay, dead_time=0.0)

    def lag(self, p: np.ndarray) -> float:
        """Of the motors in s."""
        return max(float(p[4]) * _MS, 0.0)

    def frictions(self, p: np.ndarray) -> list[drive_parts.Stribeck]:
        """Of the motors."""
        viscous, coulomb = np.exp(self.friction_factors(p)).tolist()
        return [
            replace(part, viscous=v * part.viscous, coulomb=c * part.coulomb, hump=c * part.hump)
            for part, v, c in zip(self._frictions, viscous, coulomb, strict=True)
        ]

    def friction_factors(self, p: np.ndarray) -> np.ndarray:
        """Logarithms of how many times viscous and Coulomb friction are what is believed, (2, 6)."""
        return p[5 : 5 + 2 * NUM_JOINTS].reshape(2, NUM_JOINTS)

    @staticmethod
    def believed_frictions(robot: RobotModel) -> list[drive_parts.Stribeck]:
        """Of the motors of a robot. Raises ValueError if they are of another kind."""
        return [_stribeck(robot, joint) for joint in range(NUM_JOINTS)]

    def arm(self, p: np.ndarray) -> ArmFit:
        """The fit of the arm with other dampers."""
        values = self._fit.values.copy()
        values[self._times] = p[-len(self._times) :]
        return replace(self._fit, values=values)

    def refined(self, p: np.ndarray, covariance: np.ndarray) -> ArmFit:
        """The fit of the arm with the dampers that closed loop knows better, and all that goes with them.

        Args:
            p: the unknowns.
            covariance: of them, (k, k).
        """
        fit, n = self._fit, len(self._times)
        of_times = covariance[-n:, -n:]
        better = np.flatnonzero(np.diagonal(of_times) < np.square(fit.sigma[self._times]))
        times = self._times[better]
        before = fit.covariance[np.ix_(times, times)]
        follows = np.linalg.solve(before, fit.covariance[times]).T
        values = fit.values + follows @ (p[-n:][better] - fit.values[times])
        change = follows @ (of_times[np.ix_(better, better)] - before) @ follows.T
        return replace(fit, values=values, covariance=fit.covariance + change)


class ClosedLoopProblem:
    """Residuals of the drives of all cases."""

    def __init__(
        self,
        robot: RobotModel,
        payload: float,
        unknowns: DriveUnknowns,
        recorded: Sequence[RecordedDrive],
        period: float,
    ) -> None:
        """Linearises the arm along the motions.

        Args:
            robot: with the springs that were found.
            payload: mass at the flange in kg.
            unknowns: of the closed loop.
            recorded: the motions; each begins at a tick.
            period: of the commands in s.
        """
        arm = DrivenArm(robot, payload)
        self._robot, self._payload, self._unknowns, self._period = robot, payload, unknowns, period
        self._cases = [DrivenCase(arm, each.case, robot.gear_ratio) for each in recorded]
        self._recorded = recorded
        self.evaluations = 0
        step = recorded[0].case.period
        self._ticks = max(1, round(period / step))
        self._last: tuple[DriveConfig, list[DriveTorques]] | None = None
        self._led: dict[float, list[Led]] = {}  # of all cases, by the delay

    def residuals(self, p: np.ndarray, brings_near: bool = False) -> list[np.ndarray]:
        """Of each case (m, 12): modelled less measured, speeds in rad/s and torques in N m between ticks."""
        self.evaluations += 1
        unknowns = self._unknowns
        arm = unknowns.arm(p)
        numbers = arm.parameters.numbers(arm.values)
        friction = np.array(
            [
                [part.viscous, part.coulomb, part.steepness, part.hump, part.hump_velocity]
                for part in unknowns.frictions(p)
            ]
        )
        found = []
        lag = np.full(NUM_JOINTS, unknowns.lag(p))
        drives = [replace(drive, lag=lag) for drive in self._played(p)]
        motions = side_by_side(lambda case, drive: case.run(numbers, drive, friction), self._cases, drives)
        for case, recorded, motion in zip(self._cases, self._recorded, motions, strict=True):
            if brings_near and np.isfinite(motion.moved).all():
                case.bring_near(motion.moved)
            both = np.hstack([motion.speeds, motion.torque - recorded.torque])
            # At a tick a torque is neither the one before it nor the one behind it.
            found.append(both[self._ticks // 2 :: self._ticks])
        return found

    def _played(self, p: np.ndarray) -> list[DriveTorques]:
        """What the controllers give; friction and dampers, which most steps change, do not matter."""
        config = self._unknowns.drive(p)
        if self._last is None or self._last[0] != config:
            replay = DriveReplay(self._robot, config, self._period, self._payload)
            delay = config.command_delay
            if delay not in self._led:  # here and, for a derivative, a little later
                newest = [*self._led.items()][-1:]
                led = [replay.led(each.case, each.commands[:: self._ticks]) for each in self._recorded]
                self._led = {**dict(newest), delay: led}
            self._last = config, [replay.torques(each) for each in self._led[delay]]
        return self._last[1]


def refine_drives(
    robot: RobotModel,
    payload: float,
    fit: ArmFit,
    recorded: Sequence[RecordedDrive],
    config: DriveConfig,
    period: float,
    progress: Callable[[float], None] | None = None,
) -> tuple[DriveFit, DriveUnknowns]:
    """Finds gains, delay, lag and friction of the drives, and dampers.

    Args:
        robot: as it is believed to be, that the fit of the arm began with.
        payload: mass at the flange in kg.
        fit: of the arm.
        recorded: motions with commands.
        config: of the drives, as believed.
        period: of the commands in s.
        progress: is called now and then with the share that is done, 0 to 1.
    """
    unknowns = DriveUnknowns(robot, fit, config, period)
    problem = ClosedLoopProblem(identified_robot(robot, fit), payload, unknowns, recorded, period)
    mean, root = unknowns.mean, np.linalg.cholesky(unknowns.prior)
    floor = _FLOOR * np.max([_largest(each) for each in recorded], axis=0)
    x, alike, spreads = np.zeros(len(mean)), 1.0, []
    noise = pulled = np.zeros_like(root)
    for number, steps in enumerate(_ROUNDS):
        problem.residuals(mean + root @ x, brings_near=True)
        spreads.append(_spread(problem.residuals(mean + root @ x), floor))
        x = _solve(problem, mean, root, alike * spreads[-1], x, steps)
        noise, pulled = _known(problem, mean, root, alike * spreads[-1], x)
        alike *= np.sqrt(max(1.0, np.trace(np.linalg.solve(noise, pulled)) / len(x)))
        if progress:
            progress((number + 1.0) / len(_ROUNDS))
    values = mean + root @ x
    whole = root @ (noise + pulled) @ root.T
    spread = _spread(problem.residuals(values), floor)
    return DriveFit(unknowns.names, values, whole, mean, spread, spreads[0], problem.evaluations), unknowns


def _known(
    problem: ClosedLoopProblem, mean: np.ndarray, root: np.ndarray, spread: np.ndarray, x: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Covariances of x: if nothing but noise were wrong, and how far parts of the data pull it apart.

    By their ratio the residuals are more alike than noise is: with spreads that are larger by its root they
    count for what they are worth beside what is believed.
    """
    J, left = _jacobian(problem, mean, root, spread, x), problem.residuals(mean + root @ x)
    parts = []
    for of_case, residuals in zip(J, left, strict=True):
        for rows in np.array_split(np.arange(len(residuals)), _PHASES):
            parts.append(part_of(of_case[rows], residuals[rows] / spread))
    noise = np.linalg.inv(np.sum([part.information for part in parts], axis=0) + np.eye(len(x)))
    return noise, scatter(parts, noise)


def _solve(
    problem: ClosedLoopProblem,
    mean: np.ndarray,
    root: np.ndarray,
    spread: np.ndarray,
    x: np.ndarray,
    steps: int,
) -> np.ndarray:
    def residuals(y: np.ndarray) -> np.ndarray:
        x = y - _ORIGIN
        return np.append(_whitened(problem, mean + root @ x, spread), x)

    def jacobian(y: np.ndarray) -> np.ndarray:
        by_case = _jacobian(problem, mean, root, spread, y - _ORIGIN)
        return np.vstack([*(each.reshape(-1, len(y)) for each in by_case), np.eye(len(y))])

    found = least_squares(
        residuals,
        x + _ORIGIN,
        jacobian,  # pyright: ignore[reportArgumentType]  # its stub knows names alone
        max_nfev=steps,
        xtol=_NEAR,
        ftol=_NEAR,
    )
    return found.x - _ORIGIN


def _whitened(problem: ClosedLoopProblem, p: np.ndarray, spread: np.ndarray) -> np.ndarray:
    left = np.concatenate(problem.residuals(p)) / spread
    return np.clip(np.nan_to_num(left, nan=_FAR, posinf=_FAR, neginf=-_FAR), -_FAR, _FAR).ravel()


def _jacobian(
    problem: ClosedLoopProblem, mean: np.ndarray, root: np.ndarray, spread: np.ndarray, x: np.ndarray
) -> list[np.ndarray]:
    """Of each case the derivatives of whitened residuals, (m, 12, k), by differences."""
    here = problem.residuals(mean + root @ x)
    columns = []
    for i in range(len(x)):
        moved = x.copy()
        moved[i] += _DIFFERENCE
        there = problem.residuals(mean + root @ moved)
        columns.append([(b - a) / (_DIFFERENCE * spread) for a, b in zip(here, there, strict=True)])
    return [np.nan_to_num(np.stack(of_case, axis=-1)) for of_case in zip(*columns, strict=True)]


def _spread(residuals: list[np.ndarray], floor: np.ndarray) -> np.ndarray:
    return np.maximum(_MAD * np.median(np.abs(np.concatenate(residuals)), axis=0), floor)


def _largest(recorded: RecordedDrive) -> np.ndarray:
    """Speeds and torques of a case, (12,); those of all joints of the arm for the wrist, which rests."""
    speed, torque = np.abs(recorded.case.rate).max(axis=0), np.abs(recorded.torque).max(axis=0)
    return np.concatenate([np.maximum(speed, 1e-2 * speed.max()), np.maximum(torque, 1e-3 * torque.max())])


def _stribeck(robot: RobotModel, joint: int) -> drive_parts.Stribeck:
    """What is believed of the friction of a motor, without a hump where the robot says nothing of one."""
    match robot.joints[joint].drive_train.friction:
        case drive_parts.Stribeck() as part:
            return part
        case drive_parts.Sigmoid(viscous, coulomb, steepness):
            return drive_parts.Stribeck(viscous, coulomb, steepness, 0.0)
        case drive_parts.Tanh(viscous, coulomb, width):
            return drive_parts.Stribeck(viscous, coulomb, 2.0 / width, 0.0)
        case None:
            viscous, coulomb = robot.joint_viscous_friction[joint], robot.joint_coulomb_friction[joint]
            steepness = 2.0 / robot.coulomb_velocity[joint]
            return drive_parts.Stribeck(float(viscous), float(coulomb), float(steepness), 0.0)
        case other:
            raise ValueError(
                f"drives: the friction of joint {joint + 1} is {type(other).__name__}; what is refined is "
                "Sigmoid, Tanh or Stribeck"
            )

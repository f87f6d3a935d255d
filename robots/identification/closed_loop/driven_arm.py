"""Motors in their control loops and the elastic arm behind them: figure 4.2(b) of Reiner (2010).

The equations are those of `ElasticArm`, with six coordinates more: how far the motors are beyond where they
were measured. Controllers and friction turn them. Where the model of the drives is right these coordinates
stay zero, so that it may be linear about the measured motion, as that of the arm is; an unstable loop shows
as motors that run away, not as an integrator that gives up.
"""

from dataclasses import dataclass

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.identification.arm_along_motion import ArmAlongMotion, ElasticArm
from robots.identification.arm_response import CaseOnGrid, Grid, gears_of
from robots.identification.elastic_parameters import RIPPLES_PER_TURN, ArmNumbers
from robots.identification.motion import MotionCase

STEPS = 2  # of the integration in a sample


@dataclass(frozen=True)
class DriveTorques:
    """What the controllers give along the measured motion; N steps of the integration.

    Attributes:
        told: torque in N m were the motors where they were measured, (N, 6).
        gains: by position, integral and speed of the motors, (3, 6).
        lag: of the motors in s, (6,).
    """

    told: np.ndarray
    gains: np.ndarray
    lag: np.ndarray


@dataclass(frozen=True)
class DrivenMotion:
    """How a case goes; n samples, E coordinates, of which the last six are the motors."""

    moved: np.ndarray  # (n, 3, E), beyond the measured motion of the motors, rates and accelerations
    torque: np.ndarray  # (n, 6) N m, what the motors are told to give

    @property
    def motors(self) -> np.ndarray:
        """How far the motors are beyond where they were measured in rad, (n, 6)."""
        return self.moved[:, 0, -NUM_JOINTS:]

    @property
    def speeds(self) -> np.ndarray:
        """How much faster the motors are than measured in rad/s, (n, 6)."""
        return self.moved[:, 1, -NUM_JOINTS:]


class DrivenArm(ElasticArm):
    """An elastic arm with motors that may leave the measured motion, without sensors."""

    def __init__(self, robot: RobotModel, payload: float) -> None:
        """Builds the plant; see `ElasticArm`."""
        super().__init__(robot, payload, [])
        self.sprung = np.append(self.sprung, self.motors)
        self._springs = np.append(self._springs, np.zeros(NUM_JOINTS))
        viscous = [joint.default_damping() for joint in self.parts.motors]
        self._dampers = np.append(self._dampers, viscous)

    def _levers(self) -> np.ndarray:
        return np.zeros((0, len(self.sprung)))


class DrivenCase:
    """One case of an arm in its control loops."""

    def __init__(self, arm: DrivenArm, case: MotionCase, gear_ratio: np.ndarray) -> None:
        """Linearises the arm along the measured motion; the gears have this ratio, shape (6,)."""
        self._arm, self.case, self._turns = arm, case, RIPPLES_PER_TURN * gear_ratio
        self._motion = arm.along(case)
        self._rest = np.zeros(NUM_JOINTS)
        self._build(self._motion)

    def _build(self, motion: ArmAlongMotion) -> None:
        self._grid = CaseOnGrid(motion, self.case, self._turns, Grid(STEPS), self._rest)

    def bring_near(self, moved: np.ndarray) -> None:
        """Makes the equations those about a motion that the model has found, (n, 3, E)."""
        self._build(self._arm.about(self.case, self._motion, moved))

    def run(self, numbers: ArmNumbers, drive: DriveTorques, friction: np.ndarray) -> DrivenMotion:
        """Goes through the case.

        Args:
            numbers: of the arm.
            drive: of the controllers.
            friction: of the motors, (6, 5); see `drive_through`.
        """
        from robots.identification.closed_loop.kernels import drive_through  # imports numba

        none = np.zeros(NUM_JOINTS)
        stiffness = np.append(numbers.stiffness, none)
        springs = np.stack([stiffness, stiffness * np.append(numbers.time, none)])
        gears, grid = gears_of(numbers), self._grid
        at, motion, rest, _, close, inverse = grid.posture(springs)
        load, ripple, _ = grid.course(numbers.ripple)
        start = grid.at_rest(springs, gears, numbers.ripple)[0]
        samples = len(self.case.theta)
        moved, torque = np.empty((samples, 3 * len(stiffness))), np.empty((samples, NUM_JOINTS))
        drive_through(
            self.case.period / STEPS,
            STEPS,
            (at, motion, rest, close, inverse),
            load,
            ripple,
            springs,
            gears,
            start,
            (drive.told, drive.gains, drive.lag, drive.told[0].copy()),
            (at_steps(self.case.rate), friction),
            moved,
            torque,
        )
        return DrivenMotion(moved.reshape(samples, 3, -1), torque)


def at_steps(values: np.ndarray) -> np.ndarray:
    """Values at samples, (n, 6), on straight lines between them at the steps of the integration, (N, 6)."""
    samples = np.arange(len(values))
    steps = np.arange((len(values) - 1) * STEPS + 1) / STEPS
    return np.stack([np.interp(steps, samples, column) for column in values.T], axis=1)

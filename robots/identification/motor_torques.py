"""Springs from one motion and the torques of its motors alone: no sensor but what every drive has.

A motion shows few of the springs by themselves, but it shows how fast the arm rings and by how much it yields
where it goes. What it does not show stays near what was believed: each spring has a prior.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from robots.description.model import RobotModel
from robots.description.variation import varied
from robots.identification.arm_along_motion import ElasticArm
from robots.identification.arm_fit import ArmProblem
from robots.identification.arm_response import ArmResponse
from robots.identification.elastic_parameters import ElasticParameters
from robots.identification.motion import MotionCase, SensorPlace

_STEP = 2e-3  # s; the trapezoidal rule errs by some thousandths at 20 Hz
_TIMES_KNOWN = 0.1  # standard deviation of the logarithm of retardation times, which are not kept
_FAST = 1e4  # Hz, of a torque that is shown as it is
# Errors of the model last for some samples, so that these are worth a tenth of as many that are independent.
_ALIKE = 3.0
_FLOOR = 1e-4  # of the largest torque of a joint, below which residuals need not scatter
_STEPS = (4, 2)  # of the fit, before and after the scatter of the residuals is looked at again
_TOLERANCE = 1e-3  # of the logarithms of springs


@dataclass(frozen=True)
class TorqueRecording:
    """A motion from rest as the drives report it, n samples."""

    time: np.ndarray  # (n,) s, evenly; a millisecond apart: between slower ones the motors do too much
    theta: np.ndarray  # (n, 6) rad, motors on the side of the links
    rate: np.ndarray  # (n, 6) rad/s
    torque: np.ndarray  # (n, 6) N m, on the side of the links


class MotorTorqueArm(ElasticArm):
    """An elastic arm that is watched by its motors: its six channels are their torques without Coulomb's."""

    def __init__(self, robot: RobotModel, payload: float) -> None:
        """Builds the plant; see `ElasticArm`."""
        super().__init__(robot, payload, [])

    def evaluate(self, q: np.ndarray, v: np.ndarray, vdot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `ElasticArm.evaluate`; the second part are torques in N m, shape (6,)."""
        on_springs, _ = super().evaluate(q, v, vdot)
        return on_springs, self._plant.CalcInverseDynamics(self._context, vdot, self._forces)[self.motors]

    def _levers(self) -> np.ndarray:
        return self._plant.CalcMassMatrix(self._context)[np.ix_(self.motors, self.sprung)]


def springs_from_torques(
    robot: RobotModel, payload: float, recording: TorqueRecording, spread: float
) -> RobotModel:
    """The robot with springs that explain the torques, Reiner (2010), section 4.2, by a prior each.

    Args:
        robot: as it is believed to be.
        payload: mass at the flange in kg.
        recording: a motion from rest; friction is what is believed.
        spread: share by which a spring may be off either way, any value in between as likely.

    Raises:
        ValueError: if the spread is not positive, the recording not finite or too short, or the robot has
            drive trains with more than springs, dampers and friction.
    """
    _check(robot, recording, spread)
    time = recording.time
    samples = np.arange(time[0], time[-1], _STEP)
    theta, rate, torque = (
        CubicSpline(time, each)(samples) for each in (recording.theta, recording.rate, recording.torque)
    )
    shown = torque - robot.joint_coulomb_friction * np.tanh(rate / robot.coulomb_velocity)
    case = MotionCase("motors", _STEP, theta, rate, np.zeros((len(samples), 0, 3)))
    arm = MotorTorqueArm(robot, payload)
    parameters = ElasticParameters(arm, gear_parts=False)
    is_spring = np.array(parameters.kinds) == "stiffness"
    parameters.prior_sigma = np.where(is_spring, spread / np.sqrt(3.0), _TIMES_KNOWN)
    channels = [
        SensorPlace(name, "motor torque", "", np.zeros(3), np.eye(3), _FAST, 0.0) for name in ("arm", "wrist")
    ]
    motion = arm.along(case)
    response = ArmResponse([motion], [case], channels, parameters, robot.gear_ratio)
    problem = ArmProblem(response, shown[response.kept][:, None], parameters, has_own_clock=False)
    floor = np.maximum(_FLOOR * np.abs(shown).max(axis=0), 1e-9)
    p = parameters.start.copy()
    for steps in _STEPS:
        p, _ = problem.solve(p, _ALIKE * problem.spread(p, floor), steps, _TOLERANCE)
    return varied(robot, parameters.factors(p))


def _check(robot: RobotModel, recording: TorqueRecording, spread: float) -> None:
    if not 0.0 < spread < 1.0:
        raise ValueError(f"springs from torques: the spread must be between 0 and 1, got {spread:g}")
    if robot.drive_trains is not None:
        raise ValueError(
            f"springs from torques: the drive trains of {robot.name} have parts beyond springs, dampers and "
            "friction; `truetip identify` with sensors on the links finds these"
        )
    parts = (recording.time, recording.theta, recording.rate, recording.torque)
    if len(recording.time) < 100 or not all(np.isfinite(part).all() for part in parts):
        raise ValueError(
            f"springs from torques: needs at least 100 finite samples, got {len(recording.time)}"
            + " with some that are not finite" * (not all(np.isfinite(part).all() for part in parts))
        )

"""How drives give way to torques that nobody gives them: gains as believed, and others they may have."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from scipy.linalg import expm

from robots.description.model import RobotModel
from robots.dynamics.plant import add_robot
from systems.estimation.drives.drive_config import DriveModelConfig

# Factors of the gains of position and of the integral that are believed, and of others that drives may have
FACTORS = ((1.0, 1.0), (1.0, 0.5), (1.0, 2.0), (0.6, 1.0))
_AT_ONCE = 0.1  # of a period, in which a drive without a loop of speed gives way


class DriveGains(NamedTuple):
    """Of a following error, its integral and its rate, joint side: k_d e' + k_p e + k_i int e dt = w."""

    kp: np.ndarray  # (6,) N m/rad
    ki: np.ndarray  # (4, 6), with the factors of `FACTORS`
    kd: np.ndarray  # (6,)
    # From integral, error, torque and its change to the first two, a period later, with each of those factors
    step: np.ndarray  # (4, 6, 2, 4)


def believed_gains(
    robot: RobotModel, payload: float, config: DriveModelConfig, kind: str, period: float
) -> DriveGains:
    """The gains of drives of a kind.

    Args:
        robot: that they drive.
        payload: kg, that they are tuned for.
        config: what is believed of them.
        kind: of the drives, ``"cascade"``, ``"position"`` or ``"velocity"``.
        period: s.
    """
    sets = [_gains(robot, payload, _with_factors(config, *each), kind, period) for each in FACTORS]
    kp, _, kd = sets[0]
    ki = np.array([gains[1] for gains in sets])
    return DriveGains(kp, ki, kd, np.array([filter_steps(*gains, period) for gains in sets]))


def cascade_gains(kd: np.ndarray, position: float, integral: float, period: float) -> DriveGains:
    """The gains of cascades, k_d (s + p) (s + i) = k_d s^2 + k_p s + k_i.

    Args:
        kd: of the six speed loops, N m s/rad, (6,).
        position, integral: p and i, 1/s.
        period: s.
    """
    pairs = [(p * position, i * integral) for p, i in FACTORS]
    ki = np.array([kd * p * i for p, i in pairs])
    steps = [filter_steps(kd * (p + i), kd * p * i, kd, period) for p, i in pairs]
    return DriveGains(kd * (position + integral), ki, kd, np.array(steps))


def filter_steps(kp: np.ndarray, ki: np.ndarray, kd: np.ndarray, period: float) -> np.ndarray:
    """From (integral of e, e, torque, its change in a period) to the first two a period later, (n, 2, 4)."""
    A = np.zeros((len(kd), 4, 4))
    A[:, 0, 1] = 1.0
    A[:, 1] = np.stack((-ki / kd, -kp / kd, 1.0 / kd, np.zeros(len(kd))), axis=1)
    A[:, 2, 3] = 1.0 / period
    return expm(A * period)[:, :2]


def _gains(
    robot: RobotModel, payload: float, config: DriveModelConfig, kind: str, period: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of a following error, its integral and its rate, joint side, (6,) each."""
    ratio = np.abs(robot.gear_ratio) * np.asarray(config.motor_factors)
    if kind == "position":
        kp, ki = config.stiffness * ratio, config.restoring * ratio
        return kp, ki, _AT_ONCE * period * kp
    if kind == "velocity":
        kd = config.braking * ratio
        return config.held_to_plan * kd, 1e-3 * config.held_to_plan * kd, kd
    kd = config.velocity * straight_inertia(robot, payload)
    return kd * (config.position + config.integral), kd * config.position * config.integral, kd


def straight_inertia(robot: RobotModel, payload: float) -> np.ndarray:
    """What each motor turns in the straight arm, in kg m^2, (6,)."""
    plant = MultibodyPlant(0.0)
    add_robot(plant, robot, "rigid", payload)
    plant.Finalize()
    return np.diag(plant.CalcMassMatrix(plant.CreateDefaultContext())).copy()


def _with_factors(config: DriveModelConfig, position: float, integral: float) -> DriveModelConfig:
    return replace(config, position=position * config.position, integral=integral * config.integral)

"""Six motors under their PID controllers, as linear systems that Drake integrates beside the plant."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.primitives import LinearSystem

from robots.description.model import NUM_JOINTS, RobotModel

_ZERO, _ONE = np.zeros((NUM_JOINTS, NUM_JOINTS)), np.eye(NUM_JOINTS)


@dataclass(frozen=True)
class PidGains:
    """Joint-side gains, shape (6,) each."""

    proportional: np.ndarray  # N m / rad
    integral: np.ndarray  # N m / (rad s)
    derivative: np.ndarray  # N m s / rad


def controlled_motors(
    robot: RobotModel, gains: PidGains, friction_unit: np.ndarray, sees_itself: bool = True
) -> LinearSystem:
    """Motors that turn by themselves, on gears that yield.

    States: positions and velocities of the motors, positions and velocities of the set-points, integrals of
    the position errors. Inputs: accelerations of the set-points (rad/s^2), torques to add (N m), Coulomb
    friction (in ``friction_unit``, against the motion positive) and the torques that the gears take (N m).
    Outputs: positions and velocities of the motors, their velocities over the width of Coulomb friction,
    torques of the controllers (N m), positions and velocities of the set-points; 36 numbers.

    Controllers and motors are one system because the integrator asks thousands of times a second, and most of
    what a system costs Drake is that it is one more.

    With encoders that err, the states of the motors as these have them are 12 more inputs, and the torques of
    the controllers are given without what these do to them.

    Args:
        robot: inertia, viscous friction and width of Coulomb friction of its motors.
        gains: of the controllers.
        friction_unit: torque for a friction of one, in N m, shape (6,).
        sees_itself: whether the controllers know the motors' states as they are.
    """
    P, D, I_ = np.diag(gains.proportional), np.diag(gains.derivative), np.diag(gains.integral)
    mobility, viscous = np.diag(1.0 / robot.reflected_inertia), np.diag(robot.joint_viscous_friction)
    feedback, integrated = np.hstack([-P, -D]), np.hstack([-_ONE, _ZERO])
    seen = feedback if sees_itself else 0.0 * feedback
    torque = np.hstack([seen, P, D, I_])
    A = np.block(
        [
            [_ZERO, _ONE, _ZERO, _ZERO, _ZERO],
            [mobility @ (torque - np.hstack([_ZERO, viscous, _ZERO, _ZERO, _ZERO]))],
            [_ZERO, _ZERO, _ZERO, _ONE, _ZERO],
            [np.zeros((NUM_JOINTS, 5 * NUM_JOINTS))],
            [integrated if sees_itself else 0.0 * integrated, _ONE, _ZERO, _ZERO],
        ]
    )
    B = np.zeros((5 * NUM_JOINTS, 4 * NUM_JOINTS))
    B[6:12, 6:], B[18:24, :6] = np.hstack([mobility, -mobility * friction_unit, -mobility]), _ONE
    if not sees_itself:
        still = np.zeros((NUM_JOINTS, 2 * NUM_JOINTS))
        B = np.hstack([B, np.vstack([still, mobility @ feedback, still, still, integrated])])
    state, speed = np.eye(5 * NUM_JOINTS), np.diag(1.0 / robot.coulomb_velocity)
    C = np.vstack([state[:12], speed @ state[6:12], torque, state[12:24]])
    return LinearSystem(A, B, C, np.zeros((len(C), B.shape[1])))


def motor_controllers(gains: PidGains) -> LinearSystem:
    """The controllers alone, of motors that the plant has in it.

    States as in `controlled_motors` without the motors. Inputs: accelerations of the set-points, torques to
    add, positions and velocities of the motors. Outputs: torques of the motors, torques of the controllers,
    positions and velocities of the set-points; 24 numbers.
    """
    P, D, I_ = np.diag(gains.proportional), np.diag(gains.derivative), np.diag(gains.integral)
    A = np.block([[_ZERO, _ONE, _ZERO], [_ZERO, _ZERO, _ZERO], [_ONE, _ZERO, _ZERO]])
    B = np.block([[_ZERO, _ZERO, _ZERO, _ZERO], [_ONE, _ZERO, _ZERO, _ZERO], [_ZERO, _ZERO, -_ONE, _ZERO]])
    C = np.vstack([np.hstack([P, D, I_]), np.hstack([P, D, I_]), np.eye(12, 18)])
    feedthrough = np.zeros((24, 24))
    feedthrough[:6, 6:12], feedthrough[:12, 12:18], feedthrough[:12, 18:] = (
        _ONE,
        -np.vstack([P, P]),
        -np.vstack([D, D]),
    )
    return LinearSystem(A, B, C, feedthrough)

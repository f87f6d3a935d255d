"""The quickest motion of a rigid robot along a path, which an optimiser can begin with."""

import logging

import numpy as np
from pydrake.multibody.optimization import Toppra
from pydrake.multibody.plant import MultibodyPlant
from pydrake.trajectories import PiecewisePolynomial

from robots.description.model import RobotModel
from robots.drake_log import quiet_drake
from robots.dynamics.plant import add_robot
from robots.planning.joint_path import Curve, PathError
from robots.planning.limits import MotionLimits
from robots.planning.time_spline import TimeSpline, fitted

# Knots. Where joints turn back exactly at one, the analysis may find no acceleration within the limits there;
# with others it does.
_GRIDS = (101, 111, 201)
_SAMPLES = 200
_UNLIMITED = 1e9
_ROOM = 1.15  # a motion whose torques do not jump takes longer


def quickest_rigid(
    robot: RobotModel, payload: float, path: Curve, limits: MotionLimits
) -> tuple[np.ndarray, np.ndarray]:
    """s(t) by reachability analysis: speeds, accelerations and motor torques are kept, rates not.

    Args:
        robot: the robot as the controller knows it.
        payload: mass at the flange in kg.
        path: q(s) in rad.
        limits: that are finite count.

    Returns:
        Times in s and s, shape (n,) each.

    Raises:
        PathError: if the limits admit no motion.
    """
    with quiet_drake(logging.CRITICAL):  # an analysis that fails says so as an error of Drake's
        found = next(filter(None, (_analysed(robot, payload, path, limits, grid) for grid in _GRIDS)), None)
    if found is None:
        raise PathError("the limits admit no motion along the path, not even of a rigid robot")
    times = np.linspace(found.start_time(), found.end_time(), _SAMPLES)
    return times, np.clip([float(found.value(t)[0, 0]) for t in times], 0.0, 1.0)


def _analysed(
    robot: RobotModel, payload: float, path: Curve, limits: MotionLimits, knots: int
) -> PiecewisePolynomial | None:
    """s(t), or None where the analysis fails; arguments as of `quickest_rigid`, and how many knots."""
    plant = MultibodyPlant(0.0)
    tool = add_robot(plant, robot, "rigid", payload).tool
    plant.Finalize()
    grid = np.linspace(0.0, 1.0, knots)
    curve = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(grid, path.at(grid).T)
    toppra = Toppra(curve, plant, grid)
    toppra.AddJointVelocityLimit(-limits.speed, limits.speed)
    toppra.AddJointAccelerationLimit(-limits.acceleration, limits.acceleration)
    if np.isfinite(limits.motor_torque).any():
        most = np.where(np.isfinite(limits.motor_torque), limits.motor_torque, _UNLIMITED)
        toppra.AddJointTorqueLimit(-most, most)
    if np.isfinite(limits.tool_speed):
        toppra.AddFrameTranslationalSpeedLimit(tool, limits.tool_speed)
    if np.isfinite(limits.tool_acceleration):
        # Along each axis of the world, which its magnitude may not exceed either.
        most = np.repeat([_UNLIMITED, limits.tool_acceleration], 3)
        toppra.AddFrameAccelerationLimit(tool, -most, most)
    return toppra.SolvePathParameterization()


def rigid_start(
    robot: RobotModel, payload: float, path: Curve, limits: MotionLimits, count: int
) -> TimeSpline:
    """The same as a spline with this many coefficients, somewhat slower; arguments and errors likewise."""
    times, s = quickest_rigid(robot, payload, path, limits)
    return fitted(times / times[-1], s, _ROOM * times[-1], count)

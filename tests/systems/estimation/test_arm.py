"""The fast arm against the kinematics with errors and against Drake's inverse dynamics."""

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

from robots.calibration.identifiability import identifiable_parameters
from robots.description.model import load_robot
from robots.dynamics.plant import add_robot
from robots.kinematics.error_kinematics import ErrorKinematics
from systems.estimation import kernels
from systems.estimation.arm_geometry import ArmGeometry
from systems.estimation.arm_loads import ArmLoads


def random_case(name: str, seed: int, count: int = 4):
    robot, rng = load_robot(name), np.random.default_rng(seed)
    p = rng.uniform(-1.0, 1.0, 48) * 0.02
    q, v, a = (rng.uniform(-1.0, 1.0, (count, 6)) * size for size in (1.5, 2.0, 8.0))
    return robot, p, q, v, a


@pytest.mark.parametrize("name", ["irb1200", "kr16", "kr210"])
def test_poses_and_columns_are_those_of_the_kinematics_with_errors(name):
    robot, p, q, *_ = random_case(name, 1)
    chosen = identifiable_parameters(robot).independent
    geometry = ArmGeometry(robot, chosen)
    arm = geometry.arm(geometry.constants(p), q)
    X_WE, Theta = ErrorKinematics(robot).forward_and_regressor(q, p)
    np.testing.assert_allclose(arm.X_WE, X_WE, atol=1e-12)
    np.testing.assert_allclose(arm.columns[..., :6], Theta[..., :6], atol=1e-12)
    np.testing.assert_allclose(arm.columns[..., 18:], Theta[..., chosen], atol=1e-12)


@pytest.mark.parametrize("name", ["irb1200", "kr16", "kr210"])
def test_loads_are_those_of_inverse_dynamics_with_calibrated_geometry(name):
    robot, p, q, v, a = random_case(name, 2)
    robot.counterbalance = None  # Drake has it between two points, which geometric errors move
    geometry, loads = ArmGeometry(robot, np.array([], dtype=int)), ArmLoads(robot)
    frames = geometry.arm(geometry.constants(p), q).frames
    mass = 0.6 * robot.payload.largest_mass
    shift = np.array([0.02, -0.03, 0.01])
    carried = loads.at(frames, q, v, a)
    found = carried[:, 0] + mass * carried[:, 1]
    moved = ErrorKinematics(robot).robot_with_errors(p)
    np.testing.assert_allclose(found, drake_loads(moved, mass, q, v, a), rtol=1e-9, atol=1e-9)
    # A load that is held elsewhere, at rest: its first moment is all that counts.
    still = np.zeros_like(q)
    found = loads.at(frames, q, still, still)
    found = found[:, 0] + mass * found[:, 1] + np.einsum("k,nkj->nj", mass * shift, found[:, 2:])
    centre = np.array(moved.payload.center_of_mass)
    moved.payload.center_of_mass = centre + shift
    np.testing.assert_allclose(found, drake_loads(moved, mass, q, still, still), rtol=1e-9, atol=1e-9)
    # In motion its moment of inertia about the flange is quadratic in the shift: half of what is between one
    # way and the other is the linear part, exactly.
    there = drake_loads(moved, mass, q, v, a)
    moved.payload.center_of_mass = centre - shift
    linear = 0.5 * (there - drake_loads(moved, mass, q, v, a))
    found = np.einsum("k,nkj->nj", mass * shift, carried[:, 2:])
    np.testing.assert_allclose(found, linear, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["irb1200", "kr16", "kr210"])
def test_joints_turn_what_the_mass_matrix_of_drake_has_on_its_diagonal(name):
    robot, _, q, *_ = random_case(name, 4)
    payload = 0.7 * robot.payload.largest_mass
    geometry = ArmGeometry(robot, np.array([], dtype=int))
    frames = geometry.arm(geometry.constants(np.zeros(48)), q[:1]).frames[0]
    found = ArmLoads(robot).inertias(frames, q[0], np.array([payload, 0.0, 0.0, 0.0]))
    plant = MultibodyPlant(0.0)
    add_robot(plant, robot, "rigid", payload)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q[0])
    expected = np.diag(plant.CalcMassMatrix(context)) - robot.reflected_inertia
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("name", ["irb1200", "kr16", "kr210"])
def test_motors_hold_the_arm_as_in_drake(name):
    robot, _, q, *_ = random_case(name, 3)
    payload = 0.7 * robot.payload.largest_mass
    plant = MultibodyPlant(0.0)
    parts = add_robot(plant, robot, "rigid", payload)
    plant.Finalize()
    context, geometry = plant.CreateDefaultContext(), ArmGeometry(robot, np.array([], dtype=int))
    constants, masses = geometry.constants(np.zeros(48)), ArmLoads(robot).masses
    for position in q:
        plant.SetPositions(context, position)
        frames, torques = geometry.arm(constants, position[None]).frames[0], np.empty(6)
        kernels.loads.hold(masses, payload, frames, position, torques)
        largest = np.abs(torques).max()
        np.testing.assert_allclose(torques, -parts.load(context), rtol=0.0, atol=1e-12 * largest)


def drake_loads(robot, mass, q, v, a):
    """Torques at gears and bearings of an arm of which only the motors move."""
    for link in robot.links:  # beams are stiff here
        link.beam = None
    plant = MultibodyPlant(0.0)
    parts = add_robot(plant, robot, "structure", mass)
    plant.Finalize()
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    motors = [joint.position_start() for joint in parts.motors]
    gears = [joint.velocity_start() for joint in parts.deflections]
    bearings = [joint.velocity_start() for joint in parts.structure]
    rows = []
    for position, velocity, acceleration in zip(q, v, a, strict=True):
        full = np.zeros((3, plant.num_positions()))
        full[:, motors] = position, velocity, acceleration
        plant.SetPositionsAndVelocities(context, full[:2].ravel())
        plant.CalcForceElementsContribution(context, forces)
        torque = plant.CalcInverseDynamics(context, full[2], forces)
        rows.append(torque[gears + bearings])
    return np.array(rows)


def test_a_counterbalance_relieves_axis_2():
    robot, p, q, v, a = random_case("kr210", 3)
    geometry, loads = ArmGeometry(robot, np.array([], dtype=int)), ArmLoads(robot)
    frames = geometry.arm(geometry.constants(0.0 * p), q).frames
    gears = loads.at(frames, q, v, a)[:, 0, :6]
    np.testing.assert_allclose(gears, drake_loads(robot, 0.0, q, v, a)[:, :6], rtol=1e-9, atol=1e-9)

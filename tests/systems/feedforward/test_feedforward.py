"""Inverse models: the springs carry the load, the motors carry both, and nothing grows without bound."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from scipy.integrate import solve_ivp

from robots.description.model import load_robot
from robots.dynamics.plant import add_robot
from systems.controller_model import ControllerModel
from systems.feedforward import FEEDFORWARDS, FeedforwardConfig, JointReference
from systems.feedforward.flexible_joint import FlexibleJointFeedforward
from systems.feedforward.rigid import RigidFeedforward

ROBOT = load_robot("irb1200")
PERIOD = 4e-3
STILL = JointReference(np.zeros(6), np.zeros(6), np.zeros(6))


def swinging(time: float) -> JointReference:
    """All joints at once, each with its own frequency of about one hertz."""
    rate, size = 2.0 * np.pi * np.linspace(0.5, 1.2, 6), np.linspace(0.6, 0.2, 6)
    s, c = np.sin(rate * time), np.cos(rate * time)
    return JointReference(size * s, size * rate * c, -size * rate**2 * s)


def model(stiffness_error: float = 0.0, payload: float = 7.0) -> FlexibleJointFeedforward:
    believed = ControllerModel(ROBOT, payload, PERIOD)
    return FlexibleJointFeedforward(believed, FeedforwardConfig("flexible_joint", stiffness_error))


def played(substep: float, end: float = 1.0):
    """The inverse model along the swing: its last answer, and the one before."""
    inverse = FlexibleJointFeedforward(ControllerModel(ROBOT, 7.0, 2.0 * substep), FeedforwardConfig())
    assert inverse.substep == pytest.approx(substep)
    memory, drives = np.full(inverse.memory_size, np.nan), []
    for time in np.arange(0.0, end + 0.5 * substep, substep):
        reference = swinging(time)
        drives.append(inverse.drive(reference, memory))
        memory = drives[-1].memory
    return drives[-1], drives[-2]


def test_at_rest_the_springs_carry_the_weight():
    load = np.array([0.0, 40.0, 15.0, 1.0, 2.0, 0.0])
    fresh = np.full(FlexibleJointFeedforward.memory_size, np.nan)
    drive = model().drive_under(STILL, load, fresh)
    np.testing.assert_allclose(drive.deflection, -load / ROBOT.joint_stiffness)
    np.testing.assert_allclose(drive.torque, load)
    stiffer = model(stiffness_error=0.25).drive_under(STILL, load, fresh)
    np.testing.assert_allclose(stiffer.deflection, drive.deflection / 1.25)


def test_deflections_obey_their_differential_equation():
    """A load that is linear in a sub-step errs by its square / 8 of the curvature: some nanoradians."""
    inverse, end = model(), 1.0

    def rate(time: float, deflection: np.ndarray) -> np.ndarray:
        load = inverse.link_load(swinging(time))
        return -(ROBOT.joint_stiffness * deflection + load) / ROBOT.joint_damping

    start = -inverse.link_load(swinging(0.0)) / ROBOT.joint_stiffness
    exact = solve_ivp(rate, (0.0, end), start, "Radau", rtol=1e-9, atol=1e-12).y[:, -1]
    deflection = played(2e-3)[0].deflection
    np.testing.assert_allclose(deflection, exact, atol=2.5e-8)
    assert np.abs(deflection).max() > 5e-4


def test_the_elastic_plant_needs_exactly_these_torques():
    """Drake's inverse dynamics of twelve joints: the joints of the springs need no torque beside theirs."""
    period = 1e-4  # so short that differences of rates are accelerations
    drive, before = played(period)
    reference = swinging(1.0)
    acceleration = (drive.deflection_rate - before.deflection_rate) / period
    plant = MultibodyPlant(0.0)
    robot = add_robot(plant, ROBOT, "joints", 7.0)
    plant.Finalize()
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    motors = [joint.velocity_start() for joint in robot.motors]
    springs = [joint.velocity_start() for joint in robot.deflections]
    q, v, vdot = np.zeros(12), np.zeros(12), np.zeros(12)
    for place, part, change in (
        (q, reference.position, drive.deflection),
        (v, reference.velocity, drive.deflection_rate),
        (vdot, reference.acceleration, acceleration),
    ):
        place[motors], place[springs] = part - change, change
    plant.SetPositionsAndVelocities(context, np.concatenate([q, v]))
    plant.CalcForceElementsContribution(context, forces)
    torque = plant.CalcInverseDynamics(context, vdot, forces)
    coulomb = ROBOT.joint_coulomb_friction * np.tanh(v[motors] / ROBOT.coulomb_velocity)
    np.testing.assert_allclose(torque[springs], 0.0, atol=2e-3)  # N m, of some tens
    np.testing.assert_allclose(torque[motors] + coulomb, drive.torque, atol=2e-3)


def test_the_rigid_model_moves_motors_like_links_and_gives_the_torque_of_inverse_dynamics():
    inverse = RigidFeedforward(ControllerModel(ROBOT, 7.0, PERIOD), FeedforwardConfig("rigid"))
    reference = swinging(0.3)
    drive = inverse.drive_under(reference, inverse.link_load(reference), np.full(1, np.nan))
    assert not drive.deflection.any()
    plant = MultibodyPlant(0.0)
    add_robot(plant, ROBOT, "rigid", 7.0)
    plant.Finalize()
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    plant.SetPositionsAndVelocities(context, np.concatenate([reference.position, reference.velocity]))
    plant.CalcForceElementsContribution(context, forces)
    torque = plant.CalcInverseDynamics(context, reference.acceleration, forces)
    coulomb = ROBOT.joint_coulomb_friction * np.tanh(reference.velocity / ROBOT.coulomb_velocity)
    np.testing.assert_allclose(drive.torque, torque + coulomb, atol=1e-9)


@pytest.mark.parametrize("kind", FEEDFORWARDS)
@pytest.mark.parametrize("label", ["stiffness_error", "inertia_error"])
def test_a_model_without_springs_or_masses_is_refused(kind: str, label: str):
    for error in (-1.0, np.inf, np.nan):
        with pytest.raises(ValueError, match=f"{label} must be above -1 and finite, got {error}"):
            FEEDFORWARDS[kind](ControllerModel(ROBOT), replace(FeedforwardConfig(kind), **{label: error}))

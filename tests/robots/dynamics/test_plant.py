"""The plant of a robot: inertias, springs, gravity, friction and geometric errors against closed forms."""

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context

from robots.description.geometric_errors import GeometricErrors
from robots.description.model import RobotModel, load_robot
from robots.dynamics.plant import PlantRobot, add_robot
from robots.kinematics.forward import Kinematics

ROBOT = load_robot("irb1200")
RNG = np.random.default_rng(3)
BENT = np.deg2rad([20.0, 30.0, -10.0, 40.0, 60.0, -25.0])  # away from every symmetry


def build(
    elasticity: str = "joints",
    payload: float = 7.0,
    robot: RobotModel = ROBOT,
    errors: GeometricErrors | None = None,
    gravity: float = 9.81,
) -> tuple[PlantRobot, Context]:
    plant = MultibodyPlant(0.0)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -gravity])
    parts = add_robot(plant, robot, elasticity, payload, errors)
    plant.Finalize()
    return parts, plant.CreateDefaultContext()


def rows(parts: PlantRobot) -> tuple[list[int], list[int]]:
    """Where the motors and the deflections stand among the positions, and so among the velocities."""
    return [j.position_start() for j in parts.motors], [j.position_start() for j in parts.deflections]


def without_losses() -> RobotModel:
    robot = load_robot("irb1200")  # afresh: a copy would keep the derived arrays
    for joint in robot.joints:
        joint.drive_train.damping = joint.drive_train.viscous_friction = 0.0
    return robot


def free_motion(parts: PlantRobot, context: Context) -> Simulator:
    """No torque of any motor."""
    parts.plant.get_actuation_input_port().FixValue(context, np.zeros(6))
    simulator = Simulator(parts.plant, context)
    config = SimulatorConfig(integration_scheme="runge_kutta3", accuracy=1e-8, max_step_size=1e-3)
    ApplySimulatorConfig(config, simulator)
    return simulator


def reflected(robot: RobotModel) -> np.ndarray:
    return np.array([j.drive_train.ratio**2 * j.drive_train.rotor_inertia for j in robot.joints])


def test_the_mass_matrix_is_the_one_of_the_links_beside_the_reflected_inertias():
    """In link and motor positions (q, theta) an elastic robot has no coupling between the two."""
    parts, context = build()
    rigid, rigid_context = build("rigid")
    motors, deflections = rows(parts)
    for _ in range(10):
        theta, deflection = RNG.uniform(-2.0, 2.0, 6), RNG.normal(scale=0.01, size=6)
        positions = np.zeros(12)
        positions[motors], positions[deflections] = theta, deflection
        parts.plant.SetPositions(context, positions)
        rigid.plant.SetPositions(rigid_context, theta + deflection)
        M = parts.plant.CalcMassMatrix(context)[np.ix_(motors + deflections, motors + deflections)]
        # theta = theta, deflection = q - theta
        T = np.block([[np.zeros((6, 6)), np.eye(6)], [np.eye(6), -np.eye(6)]])
        M_links = rigid.plant.CalcMassMatrix(rigid_context) - np.diag(reflected(ROBOT))
        zero = np.zeros((6, 6))
        expected = np.block([[M_links, zero], [zero, np.diag(reflected(ROBOT))]])
        np.testing.assert_allclose(T.T @ M @ T, expected, atol=1e-12)  # entries up to 10 kg m^2, rounding


def test_with_its_springs_locked_an_elastic_robot_is_the_rigid_one():
    """Inertia, Coriolis and gravity forces agree for deflections of zero."""
    parts, context = build()
    rigid, rigid_context = build("rigid")
    motors, _ = rows(parts)
    for _ in range(10):
        positions, velocities = np.zeros(12), np.zeros(12)
        positions[motors], velocities[motors] = RNG.uniform(-2.0, 2.0, 6), RNG.normal(size=6)
        for plant, at, q, v in (
            (parts.plant, context, positions, velocities),
            (rigid.plant, rigid_context, positions[motors], velocities[motors]),
        ):
            plant.SetPositions(at, q)
            plant.SetVelocities(at, v)
        for method in ("CalcBiasTerm", "CalcGravityGeneralizedForces"):
            elastic_force = getattr(parts.plant, method)(context)[motors]
            rigid_force = getattr(rigid.plant, method)(rigid_context)
            np.testing.assert_allclose(elastic_force, rigid_force, atol=1e-10)
        M = parts.plant.CalcMassMatrix(context)[np.ix_(motors, motors)]
        np.testing.assert_allclose(M, rigid.plant.CalcMassMatrix(rigid_context), atol=1e-12)


@pytest.mark.parametrize("damping", [0.0, 10.0])
def test_one_elastic_joint_swings_at_its_analytic_frequency_and_decay(damping: float):
    """Axis 6 square to all others, so that nothing moves but its motor and its load.

    Two inertias on a spring: w_0^2 = k (1/J_m + 1/J_l), decay rate d/2 (1/J_m + 1/J_l).
    """
    robot = without_losses()
    robot.joints[5].drive_train.damping = damping
    parts, context = build(robot=robot, gravity=0.0)
    motors, deflections = rows(parts)
    positions = np.zeros(12)
    positions[motors] = np.deg2rad([0.0, 30.0, 60.0, 0.0, -90.0, 0.0])
    positions[deflections[5]] = 1e-4
    parts.plant.SetPositions(context, positions)
    simulation = free_motion(parts, context)
    times = np.arange(0.0, 0.03, 1e-4)
    swing = np.empty_like(times)
    for k, time in enumerate(times):
        simulation.AdvanceTo(time)
        swing[k] = parts.plant.GetPositions(context)[deflections[5]]

    softness = 1.0 / reflected(robot)[5] + 1.0 / (robot.links[5].inertia[2] + robot.payload.inertia[2])
    decay = 0.5 * damping * softness
    frequency = np.sqrt(robot.joints[5].drive_train.stiffness * softness - decay**2)
    assert 100.0 < frequency / (2.0 * np.pi) < 150.0  # Hz, four periods in the record
    analytic = np.exp(-decay * times) * (
        np.cos(frequency * times) + decay / frequency * np.sin(frequency * times)
    )
    np.testing.assert_allclose(swing, 1e-4 * analytic, atol=1e-8)  # a phase error of 1e-4 rad


@pytest.mark.slow
def test_energy_is_conserved_in_free_motion_without_losses():
    parts, context = build(robot=without_losses())
    parts.set_at_rest(context, BENT)
    parts.plant.SetVelocities(context, RNG.normal(scale=0.3, size=12))
    simulation = free_motion(parts, context)

    def energies() -> np.ndarray:
        plant = parts.plant
        return np.array([plant.EvalKineticEnergy(context), plant.EvalPotentialEnergy(context)])

    before = energies()
    simulation.AdvanceTo(0.1)
    after = energies()
    assert abs(after[1] - before[1]) > 1.0  # J, so there is something to conserve
    assert after.sum() == pytest.approx(before.sum(), abs=1e-3)  # 1e-3 of the exchange; accuracy 1e-8


@pytest.mark.parametrize("payload", [0.0, 3.5, 7.0])
def test_at_rest_the_gears_sag_by_torque_over_stiffness_and_nothing_accelerates(payload: float):
    parts, context = build(payload=payload)
    motors, deflections = rows(parts)
    parts.set_at_rest(context, BENT)
    q = parts.plant.GetPositions(context)
    gravity = parts.plant.CalcGravityGeneralizedForces(context)
    np.testing.assert_array_equal(q[motors], BENT)
    np.testing.assert_allclose(q[deflections], gravity[deflections] / ROBOT.joint_stiffness, rtol=1e-9)
    np.testing.assert_allclose(
        gravity[motors], gravity[deflections], atol=1e-12
    )  # one torque through gear and motor
    parts.plant.get_actuation_input_port().FixValue(context, -gravity[motors])
    rates = parts.plant.EvalTimeDerivatives(context).CopyToVector()
    assert np.abs(rates).max() < 1e-6  # rad/s^2; the sag's last correction, 1e-12 of it, on 1.5e-4 kg m^2


def test_gravity_bends_the_loaded_arm_by_tenths_of_a_millimetre_and_less_with_stiffer_gears():
    """The sag shrinks in proportion, towards the rigid robot."""
    sag = {}
    for factor in (1.0, 1e3):
        robot = load_robot("irb1200")  # afresh: a copy would keep the derived arrays
        for joint in robot.joints:
            joint.drive_train.stiffness *= factor
        parts, context = build(robot=robot)
        parts.set_at_rest(context, BENT)
        sag[factor] = (
            parts.tool.CalcPoseInWorld(context).translation() - Kinematics(ROBOT).forward(BENT)[:3, 3]
        )
    assert -3e-3 < sag[1.0][2] < -1e-4
    np.testing.assert_allclose(1e3 * sag[1e3], sag[1.0], atol=0.01 * float(np.linalg.norm(sag[1.0])))


@pytest.mark.parametrize("elasticity", ["rigid", "joints"])
def test_geometric_errors_turn_the_joints_and_shift_the_tool_of_the_nominal_kinematics(elasticity: str):
    """Table 6.1 of Probst (2024) moves the true tip as eqs. (2.47), (2.48) say."""
    errors = GeometricErrors(
        np.array([1.0, 1.5, 2.0, 2.5, 3.0, 3.5]), np.array([10.0, -20.0, 30.0]), np.array([1.0, 2.0, 0.1])
    )
    shifted = load_robot("irb1200")
    shifted.tool.translation = ROBOT.tool.translation + 1e-3 * errors.tool_translation_mm
    shifted.tool.zyx_deg = ROBOT.tool.zyx_deg + errors.tool_zyx_deg
    parts, context = build(elasticity, errors=errors)
    motors, _ = rows(parts)
    for theta in RNG.uniform(-2.0, 2.0, (20, 6)):
        positions = np.zeros(parts.plant.num_positions())
        positions[motors] = theta
        parts.plant.SetPositions(context, positions)
        expected = Kinematics(shifted).forward(theta + np.deg2rad(errors.joint_offset_deg))
        np.testing.assert_allclose(parts.tool.CalcPoseInWorld(context).GetAsMatrix4(), expected, atol=1e-12)


def test_link_positions_are_motor_and_deflection_together_for_one_state_or_many():
    parts, _ = build()
    motors, deflections = rows(parts)
    states = RNG.normal(size=(4, 5, 24))
    expected = states[..., motors] + states[..., deflections]
    np.testing.assert_array_equal(parts.link_positions(states), expected)
    np.testing.assert_array_equal(parts.link_positions(states[1, 2]), expected[1, 2])
    rigid, _ = build("rigid")
    np.testing.assert_array_equal(rigid.link_positions(states), states[..., rows(rigid)[0]])


def test_viscous_friction_of_a_motor_grows_with_the_square_of_its_gear():
    parts, _ = build()
    expected = [j.drive_train.viscous_friction * j.drive_train.ratio**2 for j in ROBOT.joints]
    assert [motor.default_damping() for motor in parts.motors] == pytest.approx(expected)


def test_a_payload_adds_its_mass_at_the_flange():
    masses = []
    for payload in (0.0, 7.0):
        parts, context = build(payload=payload)
        masses.append(parts.plant.CalcTotalMass(context))
    assert masses[1] - masses[0] == pytest.approx(7.0)


@pytest.mark.parametrize("payload", [7.1, -0.1, np.nan])
def test_refuses_a_payload_that_the_robot_may_not_carry(payload: float):
    with pytest.raises(
        ValueError, match=rf"payload of ABB .* must be between 0 and 7.* kg, got {payload} kg"
    ):
        add_robot(MultibodyPlant(0.0), ROBOT, payload=payload)


def test_refuses_an_unknown_elasticity():
    with pytest.raises(ValueError, match="elasticity must be one of rigid, joints, structure, got 'rubber'"):
        add_robot(MultibodyPlant(0.0), ROBOT, "rubber")

"""Modes of elastic robots: single oscillators in closed form, the definition of a mode, what scales how."""

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from robots.description.model import RobotModel, load_robot
from robots.dynamics.modes import ModalAnalysis, stretched
from robots.dynamics.plant import PlantRobot, add_robot
from robots.kinematics.forward import Kinematics

NAMES = ["irb1200", "kr16", "kr210"]
BENT = np.deg2rad([20.0, -40.0, 60.0, 40.0, 60.0, -25.0])
STIFF = 1e9  # N m / rad: yields a millionth of the soft joint, and leaves digits to the eigenvalues


def soft_only_in(number: int, stiffness: float) -> RobotModel:
    """An IRB 1200 of which one gear yields."""
    robot = load_robot("irb1200")
    for i, joint in enumerate(robot.joints, 1):
        joint.drive_train.stiffness = stiffness if i == number else STIFF
    return robot


def plant_of(robot: RobotModel, payload: float) -> PlantRobot:
    plant = MultibodyPlant(0.0)
    parts = add_robot(plant, robot, "structure", payload)
    plant.Finalize()
    return parts


def test_a_single_joint_swings_with_the_root_of_stiffness_over_inertia():
    """Axis 6 upright, so that gravity has no part: w = sqrt(c / J), ratio = d / (2 sqrt(c J))."""
    robot = soft_only_in(6, 3e3)
    modes = ModalAnalysis(robot, "joints", 7.0).at(np.deg2rad([0.0, 0.0, 0.0, 0.0, 90.0, 0.0]))
    inertia = robot.links[5].inertia[2] + robot.payload.inertia[2]
    assert modes.angular_frequency[0] == pytest.approx(np.sqrt(3e3 / inertia), rel=1e-5)
    damping = robot.joints[5].drive_train.damping
    assert modes.damping_ratio[0] == pytest.approx(damping / (2.0 * np.sqrt(3e3 * inertia)), rel=1e-5)
    assert modes.dominant_joints(0, 1)[0] == ("deflection_6", pytest.approx(1.0, abs=1e-5))


@pytest.mark.parametrize("q2", [0.0, 180.0], ids=["upright", "hanging"])
def test_gravity_softens_what_stands_and_stiffens_what_hangs(q2: float):
    """The arm as a pendulum about axis 2: w^2 = (c -+ m g s) / J."""
    stiffness, theta = 2e3, np.deg2rad([0.0, q2, 0.0, 0.0, 0.0, 0.0])
    robot = soft_only_in(2, stiffness)
    # Whatever lies in front of axis 2 would bend it, so that it would not rest upright.
    forward = np.array([0.0, 0.0, 1.0])
    for link in robot.links[1:]:
        link.center_of_mass = link.center_of_mass * forward
    for joint in robot.joints[2:]:
        joint.placement.translation = joint.placement.translation * forward
    robot.joints[5].placement.zyx_deg = np.zeros(3)
    modes = ModalAnalysis(robot, "joints").at(theta)
    heights = np.cumsum([0.0, *(joint.placement.translation[2] for joint in robot.joints[2:])])
    levers = heights + [link.center_of_mass[2] for link in robot.links[1:]]
    masses = np.array([link.mass for link in robot.links[1:]])
    inertia = masses @ levers**2 + sum(link.inertia[1] for link in robot.links[1:])
    gravity = 9.81 * masses @ levers * np.cos(theta[1])
    expected = np.sqrt((stiffness - gravity) / inertia)
    assert modes.angular_frequency[0] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_a_mode_released_from_its_shape_swings_back_in_its_period(name: str):
    """The nonlinear plant itself, with motors too heavy to move and no dampers."""
    robot = load_robot(name)
    for joint in robot.joints:
        joint.drive_train.rotor_inertia *= 1e7
        joint.drive_train.damping = joint.drive_train.viscous_friction = 0.0
        assert joint.tilting is not None
        joint.tilting.damping = [0.0, 0.0]
    for link in robot.links:
        if link.beam is not None:
            link.beam.retardation_time = 0.0
    payload = robot.payload.largest_mass
    modes = ModalAnalysis(robot, "structure", payload).at(BENT)
    parts = plant_of(robot, payload)
    plant, rows = parts.plant, [joint.position_start() for joint in parts.sprung]
    context = plant.CreateDefaultContext()
    parts.set_at_rest(context, BENT)
    motors = [joint.position_start() for joint in parts.motors]
    plant.get_actuation_input_port().FixValue(context, -parts.load(context)[motors])
    amplitude = 1e-5 * modes.shape[:, 0] / np.abs(modes.shape[:, 0]).max()
    positions = plant.GetPositions(context)
    positions[rows] += amplitude
    plant.SetPositions(context, positions)
    simulation = Simulator(plant, context)
    ApplySimulatorConfig(
        SimulatorConfig(integration_scheme="runge_kutta3", accuracy=1e-7, max_step_size=1e-3), simulation
    )
    for half_periods in (1, 2):
        simulation.AdvanceTo(half_periods * np.pi / modes.angular_frequency[0])
        swing = plant.GetPositions(context)[rows] - modes.rest
        # Phase errors have no first order at the turning points; curvature makes terms of amplitude^2.
        np.testing.assert_allclose(swing, (-1.0) ** half_periods * amplitude, atol=2e-3 * 1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_the_damping_of_the_slow_modes_is_that_of_the_complex_eigenvalues(name: str):
    robot = load_robot(name)
    payload, theta = robot.payload.largest_mass, stretched(robot)
    modes = ModalAnalysis(robot, "structure", payload).at(theta)
    parts = plant_of(robot, payload)
    damping = np.diag([joint.default_damping() for joint in parts.sprung])
    # From the modes: M = shape^-T shape^-1 and K = shape^-T w^2 shape^-1.
    inverse = np.linalg.inv(modes.shape)
    M, K = inverse.T @ inverse, inverse.T @ np.diag(modes.angular_frequency**2) @ inverse
    zero, one = np.zeros_like(M), np.eye(len(M))
    A = np.block([[zero, one], [-np.linalg.solve(M, K), -np.linalg.solve(M, damping)]])
    poles = np.linalg.eigvals(A)
    swinging = poles[poles.imag > 0.0]
    swinging = swinging[np.argsort(np.abs(swinging))][:2]
    np.testing.assert_allclose(np.abs(swinging), modes.angular_frequency[:2], rtol=0.02)
    np.testing.assert_allclose(-swinging.real / np.abs(swinging), modes.damping_ratio[:2], rtol=0.1)


@pytest.mark.parametrize("name", NAMES)
def test_shapes_have_unit_modal_mass_and_shares_add_up(name: str):
    modes = ModalAnalysis(load_robot(name)).at(BENT)
    n = len(modes.joints)
    assert modes.shape.shape == modes.energy_share.shape == (n, n)
    np.testing.assert_allclose(modes.energy_share.sum(0), np.ones(n), rtol=1e-12)
    assert np.all(np.diff(modes.angular_frequency) >= 0.0)
    assert modes.frequency_hz == pytest.approx(modes.angular_frequency / (2.0 * np.pi))


@pytest.mark.parametrize("name", NAMES)
def test_payload_and_a_yielding_structure_make_it_slower(name: str):
    robot = load_robot(name)
    payload, theta = robot.payload.largest_mass, stretched(robot)
    lowest = [
        ModalAnalysis(robot, elasticity, mass).at(theta).frequency_hz[0]
        for elasticity, mass in (("joints", 0.0), ("joints", payload), ("structure", payload))
    ]
    assert lowest[0] > lowest[1] > lowest[2]


@pytest.mark.parametrize("name", NAMES)
def test_stretched_is_where_the_wrist_is_farthest_from_axis_1(name: str):
    robot = load_robot(name)
    theta = stretched(robot)
    assert np.all((theta >= robot.lower) & (theta <= robot.upper))
    around = np.array([theta + step * direction for step in (-0.05, 0.05) for direction in np.eye(6)[1:3]])
    within = np.all((around >= robot.lower) & (around <= robot.upper), axis=1)
    reach = np.linalg.norm(Kinematics(robot).forward(np.vstack([theta, around[within]]))[:, :2, 3], axis=1)
    # The tool's straight wrist adds the lever that the elbow's offset turns: a few millimetres.
    assert reach[0] > reach[1:].max() - 0.005


def test_an_arm_that_cannot_carry_itself_is_refused():
    robot = soft_only_in(2, 60.0)
    with pytest.raises(
        ValueError, match=r"modes of ABB .*: too soft to carry itself with the motors at \[0\.0, 0\.0"
    ):
        ModalAnalysis(robot, "joints", 7.0).at(np.zeros(6))


@pytest.mark.parametrize(
    ("elasticity", "payload", "theta", "message"),
    [
        ("rigid", 0.0, np.zeros(6), "a rigid robot has none"),
        ("rubber", 0.0, np.zeros(6), "elasticity must be one of rigid, joints, structure, got 'rubber'"),
        ("joints", 8.0, np.zeros(6), "payload of ABB .* must be between 0 and 7.* kg, got 8.0 kg"),
        ("joints", 0.0, np.zeros(5), "must be 6 finite angles"),
        ("joints", 0.0, np.full(6, np.nan), "must be 6 finite angles"),
    ],
)
def test_a_wrong_question_is_refused(elasticity: str, payload: float, theta: np.ndarray, message: str):
    with pytest.raises(ValueError, match=message):
        ModalAnalysis(load_robot("irb1200"), elasticity, payload).at(theta)

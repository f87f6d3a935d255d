"""A robot with its drives: motors and gears beside the plant are those of a plant that has them in it."""

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import ConstantVectorSource

from diagrams.driven_robot import DrivenRobot, add_driven_robot
from diagrams.scenario.scenario import StationConfig
from robots.description.drive_parts import Cubic, Exponential, Limited
from robots.description.model import RobotModel, load_robot
from robots.drivetrain.stiffening import Stiffening
from robots.dynamics.plant import add_robot
from systems.cell.drive import DriveConfig, PiGains

RNG = np.random.default_rng(2)
NUMBERS = range(1, 7)
BENT = np.deg2rad([20.0, 40.0, -30.0, 40.0, 60.0, -25.0])
Motion = dict[str, np.ndarray]  # of each joint its position and its velocity


def robot_of(stiffens: bool) -> RobotModel:
    """With linear springs, or every gear, bearing and beam with one of the characteristics."""
    parts = [Cubic(2e5), Exponential(3e6, 500.0), Limited(2e5, 4e6, 1e-3)]
    kinds = [
        Stiffening("cubic_spring", gamma=2e5),
        Stiffening("exponential_spring", gamma=500.0, c_max=1.5e5),
        Stiffening("limited_spring", gamma=2e5, c_max=1.2e5, sharpness=1e-3),
    ]
    robot = load_robot("irb1200")
    for i, joint in enumerate(robot.joints if stiffens else []):
        joint.drive_train.stiffening = kinds[i % 3]
        if joint.tilting:
            joint.tilting.stiffening_a, joint.tilting.stiffening_b = parts[i % 3], parts[(i + 1) % 3]
    for link in robot.links if stiffens else []:
        if link.beam:
            link.beam.stiffening_x, link.beam.stiffening_y = Cubic(1e5), Exponential(1e7, 300.0)
    return robot


def build(
    robot: RobotModel, elasticity: str, drive: DriveConfig | None = None, kind: str = "cascade"
) -> tuple[DrivenRobot, Diagram]:
    builder = DiagramBuilder()
    config = StationConfig(elasticity=elasticity, payload=7.0, drive=drive or DriveConfig())
    driven = add_driven_robot(builder, robot, robot, config, kind)
    still = builder.AddSystem(ConstantVectorSource(np.zeros(6)))
    for name in ("position_command", "velocity_command"):
        builder.Connect(still.get_output_port(), driven.drive.GetInputPort(name))
    return driven, builder.Build()


def evaluate(port: OutputPort, root: Context) -> np.ndarray:
    return port.Eval(port.get_system().GetMyContextFromRoot(root))


def move(plant: MultibodyPlant, context: Context, motion: Motion) -> None:
    n, state = plant.num_positions(), np.zeros(plant.num_multibody_states())
    for name, (position, velocity) in motion.items():
        joint = plant.GetJointByName(name)
        state[joint.position_start()], state[n + joint.velocity_start()] = position, velocity
    plant.SetPositionsAndVelocities(context, state)


def accelerations(plant: MultibodyPlant, context: Context, names: list[str]) -> np.ndarray:
    rates = plant.EvalTimeDerivatives(context).get_generalized_velocity().CopyToVector()
    return rates[[plant.GetJointByName(name).velocity_start() for name in names]]


def of_a_plant_with_all_in_it(
    robot: RobotModel, elasticity: str, motion: Motion, torque: np.ndarray, names: list[str]
) -> np.ndarray:
    """Accelerations to torques of the motors, from which Coulomb friction is taken here."""
    plant = MultibodyPlant(0.0)
    parts = add_robot(plant, robot, elasticity, 7.0)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    move(plant, context, motion)
    speed = np.array([motion[f"motor_{i}"][1] for i in NUMBERS])
    friction = robot.joint_coulomb_friction * np.tanh(speed / robot.coulomb_velocity)
    applied = np.zeros(plant.num_velocities())
    deflection = np.array([motion[joint.name()][0] for joint in parts.sprung])
    rows = [joint.velocity_start() for joint in parts.sprung]
    applied[rows] = -parts.stiffening_torque(deflection)
    plant.get_actuation_input_port().FixValue(context, torque - friction)
    plant.get_applied_generalized_force_input_port().FixValue(context, applied)
    return accelerations(plant, context, names)


@pytest.mark.parametrize("elasticity", ["joints", "structure"])
@pytest.mark.parametrize("stiffens", [False, True])
def test_motors_and_gears_beside_the_plant_move_as_in_it(elasticity: str, stiffens: bool):
    """Accelerations in random states, to 1e-9 of the largest: springs of 1e5 N m / rad leave rounding."""
    robot = robot_of(stiffens)
    driven, diagram = build(robot, elasticity)
    root = diagram.CreateDefaultContext()
    context = driven.plant.GetMyMutableContextFromRoot(root)
    motors_context = driven.motors.GetMyMutableContextFromRoot(root)
    structure = [joint.name() for joint in driven.links.structure]
    motors, gears = [f"motor_{i}" for i in NUMBERS], [f"deflection_{i}" for i in NUMBERS]
    for _ in range(5):
        motion = {name: RNG.normal(size=2) for name in motors}
        motion |= {name: 2e-3 * RNG.normal(size=2) for name in gears + structure}
        beside = {f"joint_{i}": motion[f"motor_{i}"] + motion[f"deflection_{i}"] for i in NUMBERS}
        move(driven.plant, context, beside | {name: motion[name] for name in structure})
        theta = np.array([motion[name] for name in motors]).T.ravel()
        motors_context.SetContinuousState(np.concatenate([theta, 0.1 * RNG.normal(size=18)]))
        torque = evaluate(driven.motor_torque, root)
        expected = of_a_plant_with_all_in_it(robot, elasticity, motion, torque, motors + gears + structure)
        links = accelerations(driven.plant, context, [*beside, *structure])
        turning = driven.motors.EvalTimeDerivatives(motors_context).CopyToVector()[6:12]
        found = np.concatenate([turning, links[:6] - turning, links[6:]])
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("elasticity", ["rigid", "joints", "structure"])
@pytest.mark.parametrize("stiffens", [False, True])
def test_at_rest_nothing_moves(elasticity: str, stiffens: bool):
    """The drives hold the load, gears and structure yield to it.

    They hold it as it is at the motors' positions: the links are some milliradians lower, which changes their
    load by a thousandth of 100 N m.
    """
    driven, diagram = build(robot_of(stiffens), elasticity)
    root = diagram.CreateDefaultContext()
    driven.set_at_rest(root, BENT)
    names = [joint.name() for joint in (*driven.links.motors, *driven.links.structure)]
    context = driven.plant.GetMyContextFromRoot(root)
    assert np.abs(accelerations(driven.plant, context, names)).max() < (
        0.3 if elasticity == "rigid" else 1e-3
    )
    rates = driven.motors.EvalTimeDerivatives(driven.motors.GetMyContextFromRoot(root)).CopyToVector()
    assert np.abs(rates).max() < 0.3


def test_a_default_context_has_the_friction_of_the_motors():
    """A moving motor is braked by -d_c i tanh(v / eps) - d_v i^2 v, Probst (2024) eqs. (2.63), (2.64)."""
    robot = load_robot("irb1200")
    driven, diagram = build(robot, "joints")
    root = diagram.CreateDefaultContext()
    v = np.array([0.01, -0.02, 0.5, -0.5, 1.0, 2.0])
    context = driven.motors.GetMyMutableContextFromRoot(root)
    context.SetContinuousState(np.concatenate([np.zeros(6), v, np.zeros(18)]))
    move(
        driven.plant,
        driven.plant.GetMyMutableContextFromRoot(root),
        {f"joint_{i}": np.array([0.0, v[i - 1]]) for i in NUMBERS},
    )
    parts = [joint.drive_train for joint in robot.joints]
    braking = [
        d.ratio * (d.viscous_friction * d.ratio * x + d.coulomb_friction * np.tanh(x / d.coulomb_velocity))
        for d, x in zip(parts, v, strict=True)
    ]
    inertia = np.array([d.rotor_inertia * d.ratio**2 for d in parts])
    rates = driven.motors.EvalTimeDerivatives(context).CopyToVector()[6:12]
    torque = evaluate(driven.motor_torque, root)
    np.testing.assert_allclose(torque - inertia * rates, braking, rtol=1e-9)


def test_structure_and_gears_that_stiffen_gain_the_energy_that_motors_give():
    """Without friction and damping, in random states; the rate of the energy by central differences."""
    robot = robot_of(True)
    for joint in robot.joints:
        train = joint.drive_train
        train.damping = train.viscous_friction = train.coulomb_friction = 0.0
        if joint.tilting:
            joint.tilting.damping = [0.0, 0.0]
    driven, diagram = build(robot, "structure")
    root = diagram.CreateDefaultContext()
    plant, gears, bearings = driven.plant, robot.stiffening_gears, driven.links.stiffening_structure
    assert gears is not None
    assert bearings is not None
    turned, bent = (
        [joint.position_start() for joint in joints]
        for joints in (driven.links.motors, driven.links.structure)
    )

    def energy(state: np.ndarray) -> float:
        root.SetContinuousState(state)
        context = plant.GetMyContextFromRoot(root)
        q, (theta, omega) = plant.GetPositions(context), evaluate(driven.motor_state, root).reshape(2, 6)
        # The plant's own potential energy has the springs of the structure as they are at rest.
        springs = gears.energy(q[turned] - theta).sum() + bearings.energy(q[bent]).sum()
        springs -= 0.5 * bearings.c_0 @ q[bent] ** 2
        moving = plant.EvalKineticEnergy(context) + 0.5 * robot.reflected_inertia @ omega**2
        return float(moving + plant.EvalPotentialEnergy(context) + springs)

    rng = np.random.default_rng(5)
    for _ in range(3):
        # Plant and motors; deflections of milliradians, at which every spring is a tenth stiffer and more.
        state = 2e-3 * rng.normal(size=root.num_continuous_states())
        root.SetContinuousState(state)
        given = float(evaluate(driven.motor_torque, root) @ evaluate(driven.motor_state, root)[6:])
        rates = diagram.EvalTimeDerivatives(root).CopyToVector()
        step = 1e-8  # s
        gained = (energy(state + step * rates) - energy(state - step * rates)) / (2.0 * step)
        assert gained == pytest.approx(given, abs=0.03)  # W, of some 5 that the stiffening of springs is


@pytest.mark.slow
def test_energy_is_conserved_between_links_motors_gravity_and_gears_that_stiffen():
    """Without friction, damping and gains; the drives give what they hold the load with, tick by tick."""
    robot = robot_of(True)
    for joint in robot.joints:
        train = joint.drive_train
        train.damping = train.viscous_friction = train.coulomb_friction = 0.0
    driven, diagram = build(robot, "joints", DriveConfig(position=PiGains(0.0, 0.0)), "position")
    simulator = Simulator(diagram)
    root = simulator.get_mutable_context()
    driven.set_at_rest(root, BENT)
    context = driven.plant.GetMyMutableContextFromRoot(root)
    driven.plant.SetVelocities(context, RNG.normal(scale=0.3, size=6))
    settings = SimulatorConfig(integration_scheme="runge_kutta3", accuracy=1e-9, max_step_size=1e-4)
    ApplySimulatorConfig(settings, simulator)
    springs = robot.stiffening_gears
    assert springs is not None

    def energies() -> np.ndarray:
        theta, omega = evaluate(driven.motor_state, root).reshape(2, 6)
        wound = springs.energy(driven.plant.GetPositions(context) - theta)
        turning = 0.5 * robot.reflected_inertia @ omega**2
        plant = driven.plant
        return np.array(
            [plant.EvalKineticEnergy(context), turning, plant.EvalPotentialEnergy(context), wound.sum()]
        )

    before, work, theta = energies(), 0.0, BENT
    for tick in range(1, 13):
        simulator.AdvanceTo(4e-3 * tick)
        moved = evaluate(driven.motor_state, root)[:6]
        # The torque that was held until now: the next one comes with the next step.
        work, theta = work + float(evaluate(driven.motor_torque, root) @ (moved - theta)), moved
    after = energies()
    assert abs(after - before).min() > 1e-3  # J, each of them takes part
    assert float(after.sum()) == pytest.approx(float(before.sum()) + work, abs=1e-5)

"""Gears that stiffen in a plant: what the linear springs lack, nothing else, and conserved energy."""

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder

from robots.description.model import RobotModel, load_robot
from robots.drivetrain.stiffening import Stiffening
from robots.dynamics.plant import PlantRobot, add_robot
from systems.cell.stiffening_gears import stiffening_gears

RNG = np.random.default_rng(2)


def stiffening_robot() -> RobotModel:
    """Every gear with one of the characteristics, without losses."""
    kinds = [
        Stiffening("cubic_spring", gamma=2e5),
        Stiffening("exponential_spring", gamma=500.0, c_max=1.5e5),
        Stiffening("limited_spring", gamma=2e5, c_max=1.2e5, sharpness=1e-3),
    ]
    robot = load_robot("irb1200")
    for i, joint in enumerate(robot.joints):
        joint.drive_train.stiffening = kinds[i % 3]
        joint.drive_train.damping = joint.drive_train.viscous_friction = 0.0
    return robot


def build(builder: DiagramBuilder) -> PlantRobot:
    plant = builder.AddSystem(MultibodyPlant(0.0))
    parts = add_robot(plant, stiffening_robot(), "joints", 7.0)
    plant.Finalize()
    return parts


def test_the_forces_are_what_the_gears_take_beyond_their_linear_springs():
    parts = build(DiagramBuilder())
    system, state = stiffening_gears(parts), 0.01 * RNG.standard_normal(24)
    context = system.CreateDefaultContext()
    system.get_input_port().FixValue(context, state)
    forces = system.get_output_port().Eval(context)
    gears = [joint.position_start() for joint in parts.deflections]
    assert parts.stiffening_gears is not None
    linear, whole = parts.sprung_stiffness * state[gears], parts.stiffening_gears.torque(state[gears])
    np.testing.assert_allclose(linear - forces[gears], whole, rtol=1e-12)
    assert not np.delete(forces, gears).any()


def test_energy_is_conserved_between_motion_gravity_and_springs():
    builder = DiagramBuilder()
    parts = build(builder)
    plant, system = parts.plant, builder.AddSystem(stiffening_gears(parts))
    builder.Connect(plant.get_state_output_port(), system.get_input_port())
    builder.Connect(system.get_output_port(), plant.get_applied_generalized_force_input_port())
    builder.ExportInput(plant.get_actuation_input_port(), "torque")
    diagram = builder.Build()
    simulator = Simulator(diagram)
    root = simulator.get_mutable_context()
    context = plant.GetMyMutableContextFromRoot(root)
    parts.set_at_rest(context, np.deg2rad([20.0, 40.0, -30.0, 40.0, 60.0, -25.0]))
    plant.SetVelocities(context, RNG.normal(scale=0.3, size=12))
    diagram.get_input_port().FixValue(root, np.zeros(6))
    config = SimulatorConfig(integration_scheme="runge_kutta3", accuracy=1e-9, max_step_size=1e-3)
    ApplySimulatorConfig(config, simulator)
    gears = [joint.position_start() for joint in parts.deflections]

    def energies() -> np.ndarray:
        x, springs = plant.GetPositions(context)[gears], parts.stiffening_gears
        assert springs is not None
        beyond = springs.energy(x) - 0.5 * parts.sprung_stiffness * x**2
        return np.array(
            [plant.EvalKineticEnergy(context), plant.EvalPotentialEnergy(context), float(beyond.sum())]
        )

    before = energies()
    simulator.AdvanceTo(0.05)
    after = energies()
    assert abs(after - before).min() > 1e-3  # J, each of them takes part
    assert float(after.sum()) == pytest.approx(float(before.sum()), abs=1e-5)

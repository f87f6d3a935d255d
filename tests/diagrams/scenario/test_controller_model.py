"""What the controller believes: the station's values where nothing is said, and any others where it is."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant

from diagrams.scenario.controller_model import controller_model
from diagrams.scenario.scenario import ScenarioError, load_scenario
from robots.description.calibration import Calibration
from robots.description.model import load_robot
from robots.dynamics.plant import add_robot
from systems.controller_model import ControllerModel
from tests.diagrams.rigs import QUIET, SETTLE, Experiment, true_errors


def believed(*settings: str, name: str = "misaligned") -> ControllerModel:
    return controller_model(load_scenario(name, list(settings)))


def test_an_empty_belief_is_the_station():
    model = believed(name="dead-time")
    robot = load_robot("irb1200")
    assert (model.payload, model.camera_delay, model.elasticity) == (7.0, 0.004, "joints")
    assert model.command_delay == pytest.approx(0.14)
    for name in ("joint_stiffness", "joint_damping", "joint_viscous_friction", "joint_coulomb_friction"):
        np.testing.assert_array_equal(getattr(model.robot, name), getattr(robot, name))


def test_a_belief_reaches_the_model_and_not_the_station():
    changes = ["payload=5", "payload_centre_mm=[1, 2, 3]", "camera_delay=0.02", "stiffness=[1.2]"]
    model = believed(*(f"servo.model.{change}" for change in changes), "servo.model.friction=[1,1,1,1,1,2]")
    robot = load_robot("irb1200")
    assert (model.payload, model.camera_delay) == (5.0, 0.02)
    np.testing.assert_allclose(model.payload_centre, [0.001, 0.002, 0.003])
    np.testing.assert_allclose(model.robot.joint_stiffness, 1.2 * robot.joint_stiffness)
    ratio = model.robot.joint_viscous_friction / robot.joint_viscous_friction
    np.testing.assert_allclose(ratio, [1, 1, 1, 1, 1, 2])


def test_a_calibrated_robot_is_what_the_controller_knows_whatever_the_scenario_says():
    """The library and the validation of a calibration had the drawing of the scenario in its place."""
    scenario, true = load_scenario("everything-realistic"), load_robot("irb1200-realistic")
    calibrated = replace(true, name="calibrated", calibration=Calibration(of="irb1200-realistic"))
    assert controller_model(scenario, calibrated).robot.name == "calibrated"
    assert controller_model(scenario, true).robot.name == load_robot("irb1200").name


def test_a_mismatch_is_bounded_repeatable_and_of_every_spring():
    settings = [f"servo.model.mismatch.{entry}" for entry in ("stiffness=0.2", "payload=0.05", "seed=4")]
    once, again = believed("robot=kr16", *settings), believed("robot=kr16", *settings)
    other = believed("robot=kr16", *settings[:2], "servo.model.mismatch.seed=5")
    springs = {}
    for label, robot in (
        ("drawn", load_robot("kr16")),
        ("once", once.robot),
        ("again", again.robot),
        ("other", other.robot),
    ):
        springs[label] = sprung(robot)
    ratio = springs["once"] / springs["drawn"]
    assert len(ratio) > 15  # gears, bearings and beams
    assert np.abs(ratio - 1.0).max() <= 0.2
    assert np.std(ratio) > 0.05
    np.testing.assert_array_equal(springs["once"], springs["again"])
    assert not np.array_equal(springs["once"], springs["other"])
    assert 0.0 < abs(once.payload / 7.0 - 1.0) <= 0.05


def sprung(robot) -> np.ndarray:
    plant = MultibodyPlant(0.0)
    parts = add_robot(plant, robot, "structure")
    plant.Finalize()
    return parts.sprung_stiffness


def test_a_heavier_load_than_the_robot_may_carry_can_be_believed():
    model = believed("servo.model.payload=9")
    limits = load_robot("irb1200").payload
    assert model.robot.payload.largest_mass == 9.0
    np.testing.assert_allclose(model.robot.payload.inertia, 9.0 / limits.largest_mass * limits.inertia)


@pytest.mark.slow
def test_a_wrong_belief_of_the_stiffness_leaves_the_open_loop_beside_its_path():
    """The feedforward winds the gears up for half their weight's deflection too much."""
    feedforward = ["servo.feedforward.kind=flexible_joint", "initial_error_mm=[0, 0, 0]", *QUIET, *SETTLE]
    errors = []
    for belief in ([], ["servo.model.stiffness=[0.5]"]):
        experiment = Experiment(load_scenario("nominal", [*feedforward, *belief]), "open_loop")
        experiment.advance(0.5)
        errors.append(np.linalg.norm(true_errors(experiment)[1][-1, 3:]))
    assert errors[0] < 1e-4  # m; the integral part of the drives is still at work
    assert errors[1] > 10.0 * errors[0]


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("stiffness=[1, 2]", r"servo.model.stiffness must be 1 or 6 numbers, got \[1, 2\]"),
        ("payload_centre_mm=[1]", "payload_centre_mm must be 3 numbers"),
        ("elasticity=gears", "servo.model.elasticity must be one of rigid, joints, structure, got 'gears'"),
    ],
)
def test_an_impossible_belief_is_refused(setting: str, message: str):
    with pytest.raises(ScenarioError, match=message):
        believed(f"servo.model.{setting}")

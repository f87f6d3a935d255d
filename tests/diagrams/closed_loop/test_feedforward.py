"""Feedforward in the closed diagram: the true tip of an elastic robot on its path, in motion and at rest."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from diagrams.record.log import RunLog
from diagrams.runs.simulation import Experiment, run
from diagrams.scenario.scenario import load_scenario
from experiments.metrics.run_metrics import summary
from robots.description.model import RobotModel, load_robot
from robots.description.robot_file import robot_text
from robots.drivetrain.stiffening import Stiffening
from systems.feedforward.prefilter import Prefilter, PrefilterConfig

# Exact geometry, 7 kg, drives of industry; the path is previewed by the command delay. Slow tests take the
# path of table 5.1, the others a circle of 100 mm in 2.4 s.
SETTINGS = [
    "station.payload=7",
    "initial_error_mm=[0, 0, 0]",
    "reference.preview=0.004",
    "reference.timing=polynomial",
    "reference.settle=0.3",
    "reference.dwell=1.0",
    "station.camera.position_sigma=0",
]
CIRCLE = ["reference.path=circle", "reference.acceleration=2", "reference.dwell=0.4"]
PATHS = ["circle", pytest.param("rectangle", marks=pytest.mark.slow)]


def path_settings(path: str) -> list[str]:
    return CIRCLE if path == "circle" else []


@cache
def errors(kind: str, law: str, stiffness_error: float = 0.0, path: str = "rectangle") -> dict:
    model = [f"servo.feedforward.kind={kind}", f"servo.feedforward.stiffness_error={stiffness_error}"]
    settings = [*path_settings(path), *model]
    scenario = load_scenario("nominal", [*SETTINGS, *settings, f"servo.laws.{law}.drive=cascade"])
    log: RunLog = run(scenario, law)
    return summary("", {law: [log]})["runs"][law]["true"]


@pytest.mark.slow
@pytest.mark.parametrize("path", PATHS)
def test_the_elastic_inverse_keeps_the_tip_on_the_path_without_a_camera(path: str):
    found = errors("flexible_joint", "open_loop", path=path)
    assert found["max_norm_mm"] <= 0.05
    assert max(found["static_mm"]) <= 0.005
    assert (
        errors("rigid", "open_loop", path=path)["max_norm_mm"] > 1.0
    )  # gravity bends a robot that thinks itself rigid


@pytest.mark.slow
def test_wrong_stiffness_leaves_its_share_and_the_camera_takes_the_rest():
    wrong = errors("flexible_joint", "open_loop", 0.2)
    assert 0.1 < wrong["max_norm_mm"] <= 0.35
    assert max(errors("flexible_joint", "position_level", 0.2)["static_mm"]) <= 0.02


STRUCTURE = ["station.elasticity=structure", "servo.laws.open_loop.drive=cascade"]


def largest_gap_mm(*settings: str, robot: RobotModel | None = None) -> float:
    """Between the true tip and a circle of 100 mm in 2.4 s, without a camera, once the arm is wound up."""
    scenario = load_scenario("nominal", [*SETTINGS, *CIRCLE, *STRUCTURE, "reference.settle=0.6", *settings])
    log = run(scenario, "open_loop", robot)
    gap = np.linalg.norm(log.X_WE_true[:, :3, 3] - log.X_WE_desired[:, :3, 3], axis=1)
    return 1e3 * float(gap[log.time >= log.path_start].max())


@pytest.mark.slow
def test_a_structure_in_the_model_takes_what_elastic_joints_leave():
    kinds = ("rigid", "flexible_joint", "elastic_structure")
    gaps = {kind: largest_gap_mm(f"servo.feedforward.kind={kind}") for kind in kinds}
    assert gaps["elastic_structure"] < 0.02
    assert gaps["elastic_structure"] < 0.1 * gaps["flexible_joint"] < 0.1 * gaps["rigid"]


@pytest.mark.slow
def test_the_geometric_correction_keeps_the_position_nearly_as_well():
    settings = ["servo.feedforward.kind=elastic_structure", "servo.feedforward.correction.method=geometric"]
    assert largest_gap_mm(*settings) < 0.1


@pytest.mark.slow
def test_behind_a_prefilter_the_tip_is_on_its_path_late_by_the_delay():
    """Previewed by that delay it is on time, but for what a filter smooths away."""
    config = PrefilterConfig("bessel", 4, 40.0)
    delay = Prefilter(config, 4e-3).delay
    settings = [
        "servo.feedforward.kind=elastic_structure",
        f"servo.feedforward.prefilter.kind={config.kind}",
        f"servo.feedforward.prefilter.cutoff_hz={config.cutoff_hz}",
    ]
    late = largest_gap_mm(*settings)
    assert late > 1.0
    assert largest_gap_mm(*settings, f"reference.preview={0.004 + delay}") < 0.1 * late


@pytest.mark.slow
def test_on_the_test_path_an_elastic_structure_is_left_by_hundredths_of_a_millimetre():
    """Table 5.1 with 7 kg; then with a model a fifth too stiff, and a camera that takes the rest."""
    settings = [*SETTINGS, *STRUCTURE, "servo.feedforward.kind=elastic_structure", "reference.settle=1"]

    def true(law: str, *more: str) -> dict:
        drive = f"servo.laws.{law}.drive=cascade"
        log = run(load_scenario("nominal", [*settings, drive, *more]), law)
        return summary("", {law: [log]})["runs"][law]["true"]

    exact = true("open_loop")
    assert exact["max_norm_mm"] <= 0.05
    assert max(exact["static_mm"]) <= 0.005
    assert max(true("position_level", "servo.feedforward.stiffness_error=0.2")["static_mm"]) <= 0.02


@pytest.mark.slow
@pytest.mark.parametrize(
    "law",
    ["numerical_ik", "pbvs", "position_level"],
)
def test_a_law_with_an_exact_model_has_little_left_to_do(law: str):
    """Also PBVS on drives that follow positions: its own start from where the motors are."""
    exact, none = (errors(kind, law, path="circle")["max_norm_mm"] for kind in ("flexible_joint", "none"))
    assert exact < 0.1 * none


def test_torque_has_a_port_on_both_sides_only_where_it_is_fed_forward():
    for kind in ("none", "rigid"):
        scenario = load_scenario("nominal", [*SETTINGS, f"servo.feedforward.kind={kind}"])
        experiment = Experiment(scenario, "open_loop")
        assert ("torque_feedforward" in experiment.servo.outputs) == (kind != "none")
        assert ("torque_feedforward" in experiment.station.inputs) == (kind != "none")


@pytest.mark.slow
@pytest.mark.parametrize("dead_time", [0.0, 0.002, 0.02])
def test_torque_arrives_as_late_as_the_positions_that_it_belongs_to(dead_time: float):
    """With the whole delay previewed, a model that is exact leaves as little as without a delay.

    Also with a delay of one period and a half.
    """
    settings = [f"station.drive.dead_time={dead_time}", f"reference.preview={0.004 + dead_time}"]
    scenario = load_scenario(
        "nominal",
        [
            *SETTINGS,
            *CIRCLE,
            *settings,
            "servo.feedforward.kind=flexible_joint",
            "servo.laws.open_loop.drive=cascade",
        ],
    )
    log = run(scenario, "open_loop")
    gap = np.linalg.norm(log.X_WE_true[:, :3, 3] - log.X_WE_desired[:, :3, 3], axis=1)
    assert 1e3 * gap[log.time >= log.path_start].max() < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("prefilter", ["none", "bessel"])
def test_its_commands_are_those_of_an_open_loop_with_its_offsets(prefilter: str):
    """A feedforward drives a robot by itself; a law without a camera adds nothing."""
    settings = ["servo.feedforward.kind=elastic_structure", f"servo.feedforward.prefilter.kind={prefilter}"]
    experiment = Experiment(
        load_scenario("nominal", [*SETTINGS, *CIRCLE, *STRUCTURE, *settings]), "open_loop"
    )
    experiment.advance(0.8)
    feedforward = experiment.diagram.GetSubsystemByName("feedforward")
    context = feedforward.GetMyContextFromRoot(experiment.context)
    moving = False
    for name in ("position_command", "velocity_command"):
        total = experiment.diagram.GetSubsystemByName(f"{name}_with_feedforward")
        expected = total.get_output_port().Eval(total.GetMyContextFromRoot(experiment.context))
        found = feedforward.GetOutputPort(name).Eval(context)
        np.testing.assert_allclose(found, expected, atol=1e-6)
        moving = np.abs(found).max() > 0.1
    assert moving


@pytest.mark.slow
def test_gears_that_stiffen_under_load_are_followed_like_linear_ones(tmp_path: Path):
    """In the plant and in the model; a model with linear springs is off by what the gears do not bend."""
    robot, path = load_robot("irb1200"), str(tmp_path / "robot.yaml")
    for joint in robot.joints:
        joint.drive_train.stiffening = Stiffening("limited_spring", gamma=2e5, c_max=9e4, sharpness=1e-3)
    Path(path).write_text(robot_text(robot))
    settings = [f"robot={path}", "servo.feedforward.kind=flexible_joint", "station.elasticity=joints"]
    linear = load_robot("irb1200")
    linear.calibration.of = path  # what the controller takes the robot for
    assert largest_gap_mm(*settings) < 0.008
    assert largest_gap_mm(*settings, robot=linear) > 0.03

"""A scenario on a robot for which it was not written: its path at another size, freely followed."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.scenario.carried import carried_over, is_alike, with_robot
from diagrams.scenario.scenario import Scenario, ScenarioError, load_scenario, scenario_text
from robots.description.model import RobotModel, load_robot
from robots.dynamics.newton_inverse import inverse_kinematics
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.kinematics.forward import Kinematics
from robots.kinematics.workspace import arm_length, dexterity
from robots.pose import rotation_vector
from systems.cell.drive import Drive
from systems.cell.events.station_events import PayloadChange
from systems.estimation.drives.drive_gains import straight_inertia
from systems.reference.paths import make_path
from systems.servo.self_calibrating.config import SelfCalibratingConfig
from tests.robots.urdfs import published

IRB1200 = load_robot("irb1200")


def robot_of(name: str) -> RobotModel:
    return load_robot(str(published(name)) if name.endswith(".urdf") else name)


def poses(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    path = make_path(scenario.reference)
    times = np.linspace(path.path_start, path.dwell_start, 300)
    return times, path.sample(times)[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur3_robot.urdf", "ur10_robot.urdf", "puma560", "kr16"])
def test_the_path_is_followed_on_one_branch_within_limits_and_speeds(name: str):
    robot = robot_of(name)
    scenario, note = carried_over(load_scenario("misaligned"), IRB1200, robot)
    assert f"carried over from {IRB1200.name} to {robot.name}" in note
    times, X = poses(scenario)
    q = inverse_kinematics(robot).along(X, np.deg2rad(scenario.home_deg))
    np.testing.assert_allclose(Kinematics(robot).forward(q), X, atol=1e-8)
    assert np.abs(np.diff(q, axis=0)).max() < 0.3
    assert (np.abs(np.diff(q, axis=0)).max(axis=0) / np.diff(times)[0] < robot.speed).all()
    assert ((q > robot.lower) & (q < robot.upper)).all()
    assert dexterity(robot, q).min() > 0.02
    assert scenario.station.payload == pytest.approx(robot.payload.largest_mass, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tx2_90", "irb140"])
def test_a_robot_that_is_off_by_centimetres_reaches_the_path_as_well(name: str):
    """By 4 % of the length of its arm, in whatever direction; a TX2-90 had 30 mm left."""
    robot = load_robot(name)
    scenario, _ = carried_over(load_scenario("everything"), IRB1200, robot)
    X = poses(scenario)[1][::5]
    ways = np.random.default_rng(0).standard_normal((24, 3))
    for way in 0.04 * arm_length(robot) * ways / np.linalg.norm(ways, axis=1)[:, None]:
        moved = X.copy()
        moved[:, :3, 3] += way
        q = inverse_kinematics(robot).along(moved, np.deg2rad(scenario.home_deg))
        assert np.abs(np.diff(q, axis=0)).max() < 1.0


@pytest.mark.slow
def test_slow_joints_get_a_slower_path_unless_its_speed_is_said():
    """A Kinova whose joints turn by 36 degrees a second."""
    robot, scenario = robot_of("kinova.urdf"), load_scenario("misaligned")
    carried, note = carried_over(scenario, IRB1200, robot)
    assert "its acceleration 0." in note
    assert carried.reference.acceleration < scenario.reference.acceleration
    times, X = poses(carried)
    q = inverse_kinematics(robot).along(X, np.deg2rad(carried.home_deg))
    assert (np.abs(np.diff(q, axis=0)).max(axis=0) / np.diff(times)[0] < 0.5 * robot.speed).all()
    with pytest.raises(ScenarioError, match=r"its joints are too slow: --set reference.acceleration"):
        carried_over(scenario, IRB1200, robot, {"reference.acceleration"})


def test_the_path_keeps_its_shape_and_its_turns():
    robot = robot_of("ur10_robot.urdf")
    scenario = load_scenario("misaligned")
    carried, _ = carried_over(scenario, IRB1200, robot)
    before, after = poses(scenario)[1], poses(carried)[1]
    lengths = [np.linalg.norm(np.diff(X[:, :3, 3], axis=0), axis=1) for X in (before, after)]
    scale = lengths[1].sum() / lengths[0].sum()
    np.testing.assert_allclose(lengths[1], scale * lengths[0], rtol=1e-4, atol=1e-7)
    assert 0.1 < scale <= arm_length(robot) / arm_length(IRB1200)
    turns = [
        np.linalg.norm(rotation_vector(X[1:, :3, :3] @ X[:-1, :3, :3].swapaxes(1, 2)), axis=-1)
        for X in (before, after)
    ]
    np.testing.assert_allclose(turns[1], turns[0], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("path", ["circle", "figure_eight", "points"])
def test_every_shape_is_carried_and_can_be_written(path: str, tmp_path: Path):
    scenario, _ = carried_over(
        load_scenario("nominal", [f"reference.path={path}"]), IRB1200, robot_of("puma560")
    )
    assert type(scenario.reference.path).kind == path
    (tmp_path / "carried.yaml").write_text(scenario_text(scenario))
    read = load_scenario(str(tmp_path / "carried.yaml"))
    np.testing.assert_allclose(poses(read)[1], poses(scenario)[1], atol=1e-12)


def test_what_is_stated_stays():
    scenario = load_scenario("misaligned")
    stated = {"reference.path.waypoints", "home_deg", "station.payload", "station.drive.motor_factors"}
    kept, note = carried_over(scenario, IRB1200, load_robot("kr16"), stated)
    assert (kept, note) == (scenario, "")


def test_the_same_machine_with_errors_keeps_the_scenario():
    p = np.random.default_rng(0).uniform(-3e-3, 3e-3, 48)
    wrong = ErrorKinematics(IRB1200).robot_with_errors(p)
    assert is_alike(IRB1200, wrong)
    assert is_alike(IRB1200, load_robot("irb1200-realistic"))
    scenario = load_scenario("everything")
    assert carried_over(scenario, IRB1200, wrong) == (scenario, "")


def test_a_load_is_the_same_share_as_far_from_its_place_wherever_it_is_named():
    settings = [
        "station.events=[!PayloadChange {at: 8, payload: 3.5, centre_mm: [0, 0, 60]}]",
        "station.drive.payload=3.5",
    ]
    before, robot = load_scenario("everything", settings), load_robot("kr16")
    scenario, _ = carried_over(before, IRB1200, robot)
    station, model = scenario.station, scenario.servo.model
    assert (station.payload, station.drive.payload) == (16.0, 8.0)
    assert model.payload == pytest.approx(6.65 / 7.0 * 16.0)
    (event,) = station.events
    assert isinstance(event, PayloadChange)
    assert event.payload == pytest.approx(8.0)
    further = 1e3 * (robot.payload.center_of_mass - IRB1200.payload.center_of_mass)
    np.testing.assert_allclose(event.centre_mm, further + np.array([0.0, 0.0, 60.0]))
    was = before.station.payload_centre_mm, before.servo.model.payload_centre_mm
    np.testing.assert_allclose((station.payload_centre_mm, model.payload_centre_mm), further + was)


def test_the_home_position_of_a_robot_file_counts():
    robot = load_robot("kr16")
    robot.home_deg = [0.0, -60.0, 90.0, 10.0, 60.0, 0.0]
    scenario, _ = carried_over(load_scenario("nominal", ["reference.path=circle"]), IRB1200, robot)
    middle = poses(scenario)[1][:, :3, 3].mean(axis=0)
    home = Kinematics(robot).forward(np.deg2rad(robot.home_deg))[:3, 3]
    np.testing.assert_allclose(middle, home, atol=0.01)


@pytest.mark.slow
def test_a_robot_that_can_follow_no_path_is_refused():
    robot = load_robot("kr16")
    for joint in robot.joints:
        joint.limits.speed_deg_s = 0.01
    with pytest.raises(ScenarioError, match=r"no place was found where KUKA KR 16-2 can .* too slow"):
        carried_over(load_scenario("misaligned"), IRB1200, robot)


@pytest.mark.parametrize(
    ("scenario", "robot", "belief"),
    [
        ("everything-realistic", "kr16-realistic", "kr16"),
        ("everything-realistic", "ur10", ""),  # a drawing itself
        ("everything", "kr16-realistic", ""),  # where the controller knows the robot as it is
    ],
)
def test_a_controller_that_knows_the_drawing_knows_that_of_another_robot(scenario, robot, belief):
    changed = with_robot(load_scenario(scenario), robot)
    assert (changed.robot, changed.servo.model.robot) == (robot, belief)


def test_the_drawing_of_a_file_is_found_beside_it(tmp_path: Path):
    (tmp_path / "drawn.yaml").write_text("extends: kr16\n")
    (tmp_path / "true.yaml").write_text("extends: drawn.yaml\n")
    changed = with_robot(load_scenario("everything-realistic"), str(tmp_path / "true.yaml"))
    assert load_robot(changed.servo.model.robot).name == load_robot("kr16").name


@pytest.mark.slow
def test_drives_turn_their_motors_as_quickly_as_those_of_the_robot_before():
    """Gains of a motor that turns 260 times as much leave 260 times as much of what it should."""
    before, robot = load_scenario("misaligned"), load_robot("kr210")
    scenario, note = carried_over(before, IRB1200, robot)
    assert "gains of its motors 100 to 260 times as large" in note

    def quickness(scenario: Scenario, robot: RobotModel) -> np.ndarray:
        drive = Drive(robot, "velocity", scenario.station.drive, 0.004, scenario.station.payload)
        return drive.gains.derivative / straight_inertia(robot, scenario.station.payload)

    np.testing.assert_allclose(quickness(scenario, robot), quickness(before, IRB1200), rtol=0.01)
    believed = scenario.servo.laws["self_calibrating"]
    assert isinstance(believed, SelfCalibratingConfig)
    assert believed.drives.motor_factors == scenario.station.drive.motor_factors


def test_gains_that_are_stated_stay():
    stated = "station.drive.velocity.proportional"
    before = load_scenario("misaligned", [f"{stated}=500"])
    scenario, _ = carried_over(before, IRB1200, load_robot("kr16"), {stated})
    assert scenario.station.drive.motor_factors == [1.0] * 6

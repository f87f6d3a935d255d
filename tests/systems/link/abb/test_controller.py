# A None where there should be something fails a test as it should.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportAttributeAccessIssue=false
"""The virtual controller: which commands it follows, when it ends, when it begins again."""

import numpy as np
import pytest
from pydrake.math import RotationMatrix

from diagrams.scenario.scenario import load_scenario
from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics
from systems.link.abb.controller import EgmRunConfig, RunState, VirtualController
from systems.link.abb.messages import Command, Mode, Pose, decode_report, encode_command
from systems.link.abb.path_program import PathProgram
from systems.reference.paths import make_path

ROBOT = load_robot("irb1200")
HOME = np.deg2rad([10.0, 20.0, -10.0, 30.0, 50.0, -40.0])
PERIOD = 4.032e-3  # s


def controller(**config) -> VirtualController:
    """A controller whose program has begun."""
    made = VirtualController(ROBOT, EgmRunConfig(**config))
    made.cycle(0.0, HOME)
    return made


def tell(made: VirtualController, mode: Mode, command: Command, seqno: int = 1, time: float = 0.0) -> None:
    made.receive(encode_command(mode, command, seqno, time), time, HOME)


def test_joints_and_speeds_are_taken_as_they_come():
    made = controller()
    tell(made, Mode.JOINT_SPEED, Command(HOME + 0.1, np.full(6, 0.2)))
    reference, speed = made.references
    np.testing.assert_allclose(reference, HOME + 0.1)
    np.testing.assert_allclose(speed, 0.2)


@pytest.mark.parametrize("mode", [Mode.POSE_QUAT, Mode.POSE_EULER])
def test_a_pose_is_taken_to_the_joints_that_reach_it(mode: Mode):
    target = HOME + 0.02
    X = Kinematics(ROBOT).forward(target)
    R = RotationMatrix(X[:3, :3])
    zyx = R.ToRollPitchYaw().vector()[::-1]
    made = controller()
    tell(made, mode, Command(pose=Pose(X[:3, 3], R.ToQuaternion().wxyz(), zyx)))
    np.testing.assert_allclose(made.references[0], target, atol=1e-9)


@pytest.mark.parametrize("is_euler", [True, False])
def test_a_speed_of_the_pose_moves_the_tool_with_that_speed(is_euler: bool):
    """Against differences of the forward kinematics; rates of Euler angles or of the quaternion."""
    kinematics, h = Kinematics(ROBOT), 1e-6
    qdot = np.array([0.1, -0.05, 0.02, 0.1, -0.1, 0.2])

    def coordinates(q: np.ndarray) -> np.ndarray:
        X = kinematics.forward(q)
        R = RotationMatrix(X[:3, :3])
        turned = R.ToRollPitchYaw().vector() if is_euler else R.ToQuaternion().wxyz()
        return np.concatenate([X[:3, 3], turned])

    rates = (coordinates(HOME + h * qdot) - coordinates(HOME - h * qdot)) / (2.0 * h)
    made = controller()
    mode = Mode.POSE_EULER_SPEED_ONLY if is_euler else Mode.POSE_QUAT_SPEED_ONLY
    tell(made, mode, Command(pose_velocity=rates))
    np.testing.assert_allclose(made.references[1], qdot, atol=1e-6)
    assert np.isnan(made.references[0]).all()


def test_a_report_tells_where_the_joints_are_and_that_commands_are_followed():
    report = decode_report(controller().report(12.5, HOME, HOME, np.zeros(6)))
    np.testing.assert_allclose(report.position, HOME, atol=1e-15)
    np.testing.assert_allclose(report.pose.position, Kinematics(ROBOT).forward(HOME)[:3, 3], atol=1e-12)
    assert report.is_ready
    assert report.time == 12.5


def test_egm_waits_for_its_first_command_and_ends_when_commands_do():
    made = controller(timeout=0.2, restart_after=-1.0)
    for k in range(500):
        made.cycle(k * PERIOD, HOME)
    assert made.is_running  # two seconds without a client
    tell(made, Mode.JOINT, Command(HOME), time=500 * PERIOD)
    ended = next(k for k in range(500, 700) if made.cycle(k * PERIOD, HOME) or not made.is_running)
    assert (ended - 500) * PERIOD == pytest.approx(0.2, abs=2 * PERIOD)
    assert np.isnan(made.references[1]).all()
    assert not decode_report(made.report(3.0, HOME, HOME, np.zeros(6))).is_ready


def test_the_program_runs_egm_again_and_counts_from_one():
    made = controller(restart_after=0.5)
    for _ in range(20):
        made.report(0.0, HOME, HOME, np.zeros(6))
    made.stop(1.0)
    made.cycle(1.4, HOME)
    assert made.state is RunState.PAUSED
    made.cycle(1.6, HOME)
    assert made.is_running
    assert decode_report(made.report(1.6, HOME, HOME, np.zeros(6))).seqno == 1
    assert made.restarts == 1


def test_convergence_ends_the_run_after_the_condition_time():
    made = controller(condition_deg=0.1, condition_time=1.0, timeout=100.0)
    tell(made, Mode.JOINT, Command(HOME))
    times = np.arange(0.0, 2.0, PERIOD)
    away = HOME + np.deg2rad(0.2)
    made.cycle(0.5, away)  # not there yet
    assert all(made.cycle(t, HOME) or made.is_running for t in 0.5 + times[times < 0.99])
    made.cycle(1.6, HOME)
    assert not made.is_running


def test_what_cannot_be_followed_is_counted_and_the_last_command_stays():
    made = controller()
    tell(made, Mode.JOINT, Command(HOME), seqno=10)
    far = Pose(np.array([5.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    tell(made, Mode.POSE_QUAT, Command(pose=far), seqno=11)
    made.receive(b"nonsense", 0.0, HOME)
    tell(made, Mode.JOINT, Command(HOME + 1.0), seqno=9)
    assert (made.ignored, made.undecodable, made.late) == (1, 1, 1)
    np.testing.assert_allclose(made.references[0], HOME)


def test_with_motors_off_nothing_is_followed():
    made = controller()
    made.motors_on = False
    tell(made, Mode.JOINT, Command(HOME + 1.0))
    assert np.isnan(made.references[1]).all()
    assert not decode_report(made.report(0.0, HOME, HOME, np.zeros(6))).motors_on


@pytest.mark.parametrize("name", ["timeout", "condition_deg", "condition_time"])
def test_times_that_are_not_positive_are_refused(name: str):
    with pytest.raises(ValueError, match=f"{name} must be positive"):
        VirtualController(ROBOT, EgmRunConfig(**{name: 0.0}))


def test_a_program_that_streams_runs_its_path_again_and_again_whatever_it_is_told():
    """Its references go on without a jump from the end of a lap to the beginning of the next."""
    path = make_path(load_scenario("cell", ["reference.path=circle", "reference.acceleration=6"]).reference)
    home = np.deg2rad(load_scenario("cell").home_deg)
    config = EgmRunConfig(streams=True)
    made = VirtualController(ROBOT, config, program=PathProgram(ROBOT, path, home, config.correction_lag))
    period, planned, told = 0.02, home, []
    for tick in range(round((2.2 * path.duration + 10.0) / period)):
        time = tick * period
        tell(made, Mode.JOINT, Command(HOME), seqno=tick, time=time)
        made.cycle(time, planned)
        planned = made.references[0]
        told.append(planned)
    assert made.ignored == len(told)
    assert not decode_report(made.report(1.0, planned, planned, np.zeros(6))).is_ready
    steps = np.abs(np.diff(told, axis=0))
    assert (steps <= 1.01 * ROBOT.speed * period).all()
    # It comes by the farthest place of its path in every lap.
    far = np.linalg.norm(np.array(told) - told[0], axis=1)
    visits = np.count_nonzero(np.diff((far > 0.9 * far[200:].max()).astype(int)) > 0)
    assert visits >= 2


def test_a_program_cannot_stream_and_be_corrected():
    both = [f"station.link.run.{name}=true" for name in ("streams", "path_correction")]
    with pytest.raises(ValueError, match=r"station\.link: a program that streams takes no corrections"):
        load_scenario("cell", both)

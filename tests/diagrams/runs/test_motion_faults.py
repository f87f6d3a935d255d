"""Clocks that are set, messages that are lost, joints that jump: no message moves a robot by surprise."""

import re

import numpy as np
import pytest

from diagrams.runs.real_time import REQUESTED, RealTimeRecord, RealTimeRun
from diagrams.scenario.scenario import Scenario, ScenarioError, load_scenario
from diagrams.servo import Servo
from robots.description.model import load_robot
from systems.link.abb.messages import decode_command
from tests.diagrams.lockstep import Lockstep

ROBOT = load_robot("irb1200")
PERIOD = 4.032e-3  # s
FAST = ["reference.acceleration=6", "reference.settle=0.5", "reference.path=circle", "reference.dwell=0.3"]
FASTER = ["servo.guard.resume_time=0.3", "station.link.run.restart_after=0.1"]


def faulty(*settings: str) -> Scenario:
    return load_scenario("cell", [*FAST, *FASTER, *settings])


def guided(scenario: Scenario, law: str = "open_loop", **options) -> tuple[RealTimeRecord, Lockstep]:
    wire = Lockstep(scenario)
    record = RealTimeRun(scenario, law).run(wire.link, wire.camera(), now=wire.now, **options)
    return record, wire


def commands(wire: Lockstep) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
    """Times (n,) in s, positions (n, 6), None if only speeds were sent, and speeds (n, 6) of all messages."""
    decoded = [decode_command(data)[1] for _, data in wire.sent]
    times = np.array([time for time, _ in wire.sent])
    velocity = np.array([command.velocity for command in decoded])
    if decoded[0].position is None:
        return times, None, velocity
    return times, np.array([command.position for command in decoded]), velocity


def assert_unsurprising(wire: Lockstep) -> None:
    """From message to message, in the time that the client saw pass, within speed and acceleration.

    A message that comes late is followed by one that seems early: a period is granted to both together.
    """
    times, position, velocity = commands(wire)
    passed = np.diff(times)[:, None] + 0.25 * PERIOD
    assert (np.abs(np.diff(velocity, axis=0)) <= ROBOT.acceleration * passed + 1e-9).all()
    assert (np.abs(velocity) <= ROBOT.speed * (1.0 + 1e-6)).all()
    if position is not None:
        speed = np.diff(position, axis=0) / np.diff(times)[:, None]
        assert (np.abs(speed) <= ROBOT.speed * (1.0 + 1e-6)).all()
        between = 0.5 * (passed[1:] + passed[:-1])
        assert (np.abs(np.diff(speed, axis=0)) <= ROBOT.acceleration * between + 1e-6).all()


def assert_stopped(wire: Lockstep, fault_at: float) -> None:
    """The last messages are at rest, and on the way there the robot was slowed down over the stop time."""
    times, position, velocity = commands(wire)
    assert not velocity[-5:].any()
    if position is not None:
        np.testing.assert_array_equal(position[-5:], position[-1:].repeat(5, axis=0))
    moving = np.flatnonzero(velocity.any(axis=1))
    assert 0.1 < times[moving[-1]] - fault_at < 0.8


def middle_of_path(scenario: Scenario) -> float:
    """An instant of the cell's time at which the robot is on its path, in s."""
    wire = Lockstep(scenario)
    run = RealTimeRun(scenario, "open_loop")
    state = {"at": 0.0}

    def note(share: float) -> None:
        state["at"] = state["at"] or (wire.now() if share > 0.55 else 0.0)

    run.run(wire.link, wire.camera(), progress=note, now=wire.now)
    return state["at"]


@pytest.fixture(scope="module")
def on_path() -> float:
    return middle_of_path(faulty())


def test_a_clock_that_is_set_forward_moves_nothing_and_is_noted(on_path: float):
    record, wire = guided(faulty(f"station.faults.clock_step_at={on_path}"))
    assert record.ended == "path"
    assert [event.detail for event in record.events if event.kind == "clock_step"] == [
        "the controller's clock went 1 s ahead"
    ]
    assert_unsurprising(wire)
    assert record.limited_messages == 0  # the path went on along its own time


@pytest.mark.parametrize("law", ["open_loop", "pbvs"])
@pytest.mark.parametrize(
    ("fault", "why"),
    [
        ("clock_step_at={at},clock_step=-1", "the controller's clock stepped back by 1 s"),
        ("joint_jump_at={at}", "a joint jumped by"),
    ],
)
def test_what_cannot_be_believed_ends_the_run_by_name_with_a_smooth_stop(law, fault, why, on_path: float):
    """The same where only speeds are sent, which would go on for ever."""
    settings = [f"station.faults.{part}" for part in fault.format(at=on_path).split(",")]
    record, wire = guided(faulty(*settings), law)
    assert record.ended.startswith(why)
    assert_unsurprising(wire)
    assert_stopped(wire, on_path)


@pytest.mark.parametrize("lost", [0.05, 0.09])
def test_messages_that_are_lost_for_a_while_cost_time_and_no_jump(lost: float, on_path: float):
    record, wire = guided(faulty(f"station.faults.stall_at={on_path}", f"station.faults.stall_for={lost}"))
    assert record.ended == "path"
    assert [event.kind for event in record.events] == ["interrupted"]
    assert_unsurprising(wire)


@pytest.mark.parametrize("resume", [False, True])
def test_a_camera_that_sees_nothing_any_more_stops_the_robot_and_the_run_says_so(resume: bool):
    """The path is not over when its time is: the robot stands."""
    settings = [f"servo.guard.resume={str(resume).lower()}", "servo.guard.stop_after=0.2"]
    record, wire = guided(faulty(*settings, "station.camera.dropouts=[[1.2, 60]]"), "numerical_ik")
    assert re.fullmatch(
        r"stopped by the guard at \d\.\d s: the camera has shown nothing usable since \d\.\d s", record.ended
    )
    assert_unsurprising(wire)
    assert not commands(wire)[2][-5:].any()


def test_one_switch_leads_back_after_a_longer_silence(on_path: float):
    record, wire = guided(
        faulty(
            f"station.faults.stall_at={on_path}", "station.faults.stall_for=0.5", "servo.guard.resume=true"
        )
    )
    assert record.ended == "path"
    assert len(record.pauses) == 1
    assert_unsurprising(wire)


def test_the_former_name_of_the_switch_is_understood():
    assert faulty("station.link.on_break=resume").servo.guard.resume
    assert not faulty("station.link.on_break=end").servo.guard.resume


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_who_wants_an_end_gets_a_smooth_stop_and_what_was_recorded(share: float):
    wanted: list[float] = []
    scenario = faulty()
    wire = Lockstep(scenario)

    def note(done: float) -> None:
        if done > share and not wanted:
            wanted.append(wire.now())

    record = RealTimeRun(scenario, "open_loop").run(
        wire.link, wire.camera(), progress=note, now=wire.now, is_asked_to_end=lambda: bool(wanted)
    )
    assert record.ended == REQUESTED
    assert 0.0 < record.log.time[-1] < record.log.path_end
    assert_unsurprising(wire)
    assert_stopped(wire, wanted[0])


def test_an_end_is_heard_on_the_way_to_the_start_too():
    record, wire = guided(faulty(), is_asked_to_end=lambda: True)
    assert record.ended == REQUESTED
    assert not len(record.stamps)
    assert not wire.sent


def test_a_camera_whose_first_sample_comes_after_the_stop_is_refused_beforehand():
    scenario = faulty("station.camera.delay=0.5")
    with pytest.raises(
        ScenarioError, match=r"delay=0\.5 s and .*period=0\.004 s must be below .*stop_after=0\.5"
    ):
        Servo(ROBOT, scenario, "numerical_ik")

"""Clocks that are set, messages that are lost, joints that jump: no message moves a robot by surprise."""

import re

import numpy as np
import pytest

from diagrams.hardware_link import StationError
from diagrams.runs.real_time import REQUESTED, RealTimeRecord, RealTimeRun
from diagrams.scenario.scenario import Scenario, ScenarioError, load_scenario
from diagrams.servo import Servo
from robots.description.model import load_robot
from systems.link.abb.messages import decode_command
from tests.diagrams.lockstep import Lockstep

ROBOT = load_robot("irb1200")
PERIOD = 4.032e-3  # s
FAST = ["reference.acceleration=6", "reference.settle=0.5", "reference.path=circle", "reference.dwell=0.3"]
LONGEST_STEP = 8.5 * PERIOD  # s; where more lies between two stamps a clock was set, or many came at once
LONGEST_OWED = 0.25  # s
SLACK = 1.0 + 1e-5  # stamps are in microseconds
FASTER = ["servo.guard.resume_time=0.3", "station.link.run.restart_after=0.1"]


def faulty(*more: str) -> Scenario:
    return load_scenario("cell", [*FAST, *FASTER, *more])


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


def longest_passed(here: np.ndarray, stamped: np.ndarray) -> np.ndarray:
    """Most that may have passed from message to message in s: what the stamps say, as far as it is owed.

    Owed is the time here that has not been counted yet, of which up to `LONGEST_OWED` is kept for messages
    that come early after late ones, and one period besides. Where stamps stand or go back for long it is a
    period.
    """
    passed, owed = np.maximum(stamped, 0.0), PERIOD
    for message, waited in enumerate(here):
        owed += waited
        if passed[message] == 0.0 and waited > LONGEST_STEP:
            passed[message] = PERIOD
        passed[message] = min(passed[message], owed)
        owed = min(owed - passed[message], LONGEST_OWED)
    return passed


def assert_unsurprising(wire: Lockstep) -> None:
    """From message to message within speed and acceleration, in the time that really passed.

    That is the time of the messages that are answered, by the controller's clock, and in sum no more than has
    passed here. Where the stamps do not say it, it is the time in which the robot goes as far at its
    velocity, and never more than may have passed.
    """
    times, position, velocity = commands(wire)
    here, stamped = np.diff(times), np.diff(wire.stamps)
    passed = longest_passed(here, stamped)
    assert (np.abs(np.diff(velocity, axis=0)) <= ROBOT.acceleration * passed[:, None] * SLACK + 1e-9).all()
    assert (np.abs(velocity) <= ROBOT.speed * SLACK).all()
    if position is not None:
        way, mean = np.diff(position, axis=0), 0.5 * (velocity[1:] + velocity[:-1])
        is_known = (stamped > 0.0) & (stamped <= LONGEST_STEP) & (passed > stamped - 1e-9)
        # At rest, or after a silence, a robot is led on from where it says that it stands.
        is_anew = ~velocity[1:].any(axis=1) & ~(is_known & velocity[:-1].any(axis=1))
        off = np.abs(position - np.array(wire.measured))[1:][is_anew & way.any(axis=1)]
        assert (off <= ROBOT.speed * PERIOD).all()
        way[is_anew] = 0.0
        fitted = (way * mean).sum(axis=1) / np.maximum((mean**2).sum(axis=1), 1e-12)
        passed = np.where(is_known | is_anew, passed, np.clip(fitted, 0.0, passed))
        moves = passed > 1e-5
        np.testing.assert_allclose(way[~moves], 0.0, atol=1e-5 * ROBOT.speed.max())
        passed = passed[moves, None]
        speed = way[moves] / passed
        assert (np.abs(speed) <= ROBOT.speed * SLACK).all()
        between = 0.5 * (passed[1:] + passed[:-1])
        assert (np.abs(np.diff(speed, axis=0)) <= ROBOT.acceleration * between * SLACK + 1e-6).all()


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


@pytest.mark.slow
def test_a_clock_that_is_set_forward_moves_nothing_and_is_noted(on_path: float):
    record, wire = guided(faulty(f"station.faults.clock_step_at={on_path}"))
    assert record.ended == "path"
    assert [event.detail for event in record.events if event.kind == "clock_step"] == [
        "the controller's clock went 1 s ahead"
    ]
    assert_unsurprising(wire)
    assert record.limited_messages == 0  # the path went on along its own time


@pytest.mark.slow
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
    chosen = [f"station.faults.{part}" for part in fault.format(at=on_path).split(",")]
    record, wire = guided(faulty(*chosen), law)
    assert record.ended.startswith(why)
    assert_unsurprising(wire)
    assert_stopped(wire, on_path)


@pytest.mark.slow
@pytest.mark.parametrize("lost", [0.05, 0.09])
def test_messages_that_are_lost_for_a_while_cost_time_and_no_jump(lost: float, on_path: float):
    record, wire = guided(faulty(f"station.faults.stall_at={on_path}", f"station.faults.stall_for={lost}"))
    assert record.ended == "path"
    assert [event.kind for event in record.events] == ["interrupted"]
    assert_unsurprising(wire)


def halted(law: str, seconds: float, catches_up: bool, resume: bool) -> tuple[RealTimeRecord, Lockstep]:
    """On a circle that the robot can just run; its joints turn with half their speed when the cell stops."""
    # At its end the robot waits until the clocks are known again, and is led on then.
    settings = ["reference.acceleration=30", "reference.dwell=2", f"servo.guard.resume={str(resume).lower()}"]
    scenario = faulty(*settings)
    wire = Lockstep(scenario)
    wire.halts = [(1.6, seconds, catches_up)]
    record = RealTimeRun(scenario, law).run(wire.link, wire.camera(), now=wire.now)
    assert np.abs(commands(wire)[2] / ROBOT.speed).max() > 0.4
    return record, wire


HALTS = [(0.03, True), (0.08, False), (0.2, True)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "seconds", "catches_up", "resume"),
    [
        ("numerical_ik", 1.0, False, True),
        *(("numerical_ik", *halt, True) for halt in HALTS),
        *(("pbvs", *halt, False) for halt in HALTS),
    ],
)
def test_a_cell_that_stood_still_is_led_on_from_where_it_was(law, seconds, catches_up, resume):
    """Its clock stood with it: for the robot no time has passed, and it still moves as it was told last."""
    record, wire = halted(law, seconds, catches_up, resume)
    assert record.ended == ("path" if resume or seconds < 0.1 else "the controller fell silent")
    assert_unsurprising(wire)


SILENCES = ["stall_at={at},stall_for=0.05", "stall_at={at},stall_for=0.3", "stop_at={at}"]
ANY = [
    *SILENCES,
    "clock_step_at={at},clock_step=1",
    "clock_step_at={at},clock_step=-1",
    "joint_jump_at={at}",
    "loss=0.1,reordering=0.1,duplication=0.1,jitter=0.006,burst=0.01,burst_length=5",
]
HALTED_FOR = (0.01, 0.05, 0.09, 0.12, 0.2, 1.0)  # s


def drawn(seed: int, faults: list[str]) -> tuple[list, list, str, bool]:
    """Up to three halts, up to two faults and when they happen, a law, and whether it goes on after a stop.

    The same wherever it runs: drawn by hypothesis they depend on what else has been imported.
    """
    rng = np.random.default_rng(seed)
    halts = [
        (rng.uniform(1.2, 2.4), float(rng.choice(HALTED_FOR)), bool(rng.integers(2)))
        for _ in range(rng.integers(1, 4))
    ]
    kinds = rng.choice(faults, size=rng.integers(3), replace=False)
    chosen = {str(kind).split("_at")[0]: (str(kind), rng.uniform(1.2, 2.4)) for kind in kinds}  # each once
    law = ("numerical_ik", "pbvs")[rng.integers(2)]
    return halts, list(chosen.values()), law, bool(rng.integers(2))


def halted_with(halts: list, chosen: list, law: str, resume: bool) -> Lockstep:
    parts = [part for text, at in chosen for part in text.format(at=at).split(",")]
    scenario = faulty(
        "reference.acceleration=30",
        f"servo.guard.resume={str(resume).lower()}",
        "station.link.resume_within=3",
        *(f"station.faults.{part}" for part in parts),
    )
    wire = Lockstep(scenario)
    wire.halts = halts
    RealTimeRun(scenario, law).run(wire.link, wire.camera(), now=wire.now)
    return wire


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_nor_does_any_sequence_of_halts_and_silences_surprise(seed: int):
    assert_unsurprising(halted_with(*drawn(seed, SILENCES)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_whatever_comes_no_message_is_further_than_a_robot_gets_in_the_longest_gap_bridged(seed: int):
    """Also where stamps go back in a burst, so that nobody can say what time has passed."""
    halts, chosen, law, _ = drawn(seed, ANY)
    _, position, velocity = commands(halted_with(halts, chosen, law, resume=False))
    assert (np.abs(velocity) <= ROBOT.speed * SLACK).all()
    assert (np.abs(np.diff(velocity, axis=0)) <= ROBOT.acceleration * LONGEST_STEP).all()
    if position is not None:
        assert (np.abs(np.diff(position, axis=0)) <= ROBOT.speed * LONGEST_STEP).all()


@pytest.mark.slow
@pytest.mark.parametrize("resume", [False, True])
def test_a_camera_that_sees_nothing_any_more_stops_the_robot_and_the_run_says_so(resume: bool):
    """The path is not over when its time is: the robot stands."""
    more = [f"servo.guard.resume={str(resume).lower()}", "servo.guard.stop_after=0.2"]
    record, wire = guided(faulty(*more, "station.camera.dropouts=[[1.2, 60]]"), "numerical_ik")
    assert re.fullmatch(
        r"stopped by the guard at \d\.\d s: the camera has shown nothing usable since \d\.\d s", record.ended
    )
    assert_unsurprising(wire)
    assert not commands(wire)[2][-5:].any()


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_joints_that_jump_on_the_way_to_the_start_end_it_with_a_smooth_stop():
    """Who led on from where they are said to be would drive the robot elsewhere."""
    before = Lockstep(faulty())
    RealTimeRun(faulty(), "open_loop").run(
        before.link, before.camera(), now=before.now, is_asked_to_end=lambda: len(before.sent) > 50
    )
    at, _ = before.sent[50]
    scenario = faulty(f"station.faults.joint_jump_at={at}")
    wire = Lockstep(scenario)
    with pytest.raises(StationError, match="a joint jumped by"):
        RealTimeRun(scenario, "open_loop").run(wire.link, wire.camera(), now=wire.now)
    assert_unsurprising(wire)
    assert_stopped(wire, at)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "settings", "at"),
    [
        ("open_loop", [], 0.0),
        ("open_loop", [], 1.9),  # s, on the path
        ("pbvs", ["servo.laws.pbvs.drive=velocity"], 1.9),
        ("numerical_ik", [], 1.9),
    ],
)
def test_a_controller_that_takes_no_commands_ends_the_run_by_name(law: str, settings: list[str], at: float):
    """Nothing in its messages says so; an open loop would have ended as if it had run its path."""
    record, wire = guided(faulty(f"station.faults.deaf_at={at}", *settings), law)
    assert re.match(r"the robot does not follow: joint \d stands still", record.ended)
    assert_unsurprising(wire)


@pytest.mark.slow
def test_nor_is_it_waited_for_on_the_way_to_the_start():
    wire = Lockstep(faulty("station.faults.deaf_at=0", "reference.path=rectangle"))
    with pytest.raises(StationError, match="the robot does not follow: joint"):
        RealTimeRun(faulty(), "open_loop").run(wire.link, wire.camera(), now=wire.now)
    assert wire.time < 5.0  # s
    assert_unsurprising(wire)


def test_a_camera_whose_first_sample_comes_after_the_stop_is_refused_beforehand():
    scenario = faulty("station.camera.delay=0.5")
    with pytest.raises(
        ScenarioError, match=r"delay=0\.5 s and .*period=0\.004 s must be below .*stop_after=0\.5"
    ):
        Servo(ROBOT, scenario, "numerical_ik")

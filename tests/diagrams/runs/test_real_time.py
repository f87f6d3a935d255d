"""The servo of the simulation behind the bytes of a real station: as accurate, and safe when things fail."""

from typing import Any

import numpy as np
import pytest

from diagrams.runs.real_time import RealTimeRecord, RealTimeRun, StationError
from diagrams.runs.simulation import run
from diagrams.scenario.scenario import Scenario, load_scenario
from robots.description.model import load_robot
from robots.pose import pose_error
from systems.guard.guard import KINDS
from tests.diagrams.lockstep import Lockstep

QUICK = ["reference.path=circle", "reference.acceleration=1.2", "reference.settle=2"]
PERIOD = 4.032e-3  # s
# Beginning at 3.2 s, when the law has pulled the tip onto the path; that itself takes 100 rad/s^2.
SETTLED, HARSH = 800, 60.0  # ticks, rad/s^2
NOISE = ["loss=0.05", "duplication=0.02", "reordering=0.02", "jitter=0.003"]


def quick(*settings: str) -> Scenario:
    return load_scenario("cell", [*QUICK, *settings])


def guided(scenario: Scenario, law: str = "numerical_ik") -> tuple[RealTimeRecord, Any, Lockstep]:
    """The record of a run, the true errors by tick (n, 6), and the wire."""
    wire = Lockstep(scenario)
    record = RealTimeRun(scenario, law).run(wire.link, wire.camera(), now=wire.now)
    stamps, ticks = record.stamps, np.arange(len(record.stamps))
    heard = np.isfinite(stamps)
    X_WE, _ = wire.cell.record().at(np.interp(ticks, ticks[heard], stamps[heard]))
    return record, pose_error(record.log.X_WE_desired, X_WE), wire


def largest_and_static(log, e: np.ndarray) -> tuple[float, float]:
    """Largest true distance on the path and mean one over the last half second, in mm."""
    path, rest = log.time >= log.path_start, log.time > log.path_end - 0.5
    largest = float(np.linalg.norm(e[path, 3:], axis=1).max())
    return 1e3 * largest, 1e3 * float(np.linalg.norm(e[rest, 3:].mean(axis=0)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "settings"),
    [
        ("numerical_ik", []),
        ("pbvs", ["reference.override=[{at: 2.2, share: 0.7}]"]),
    ],
)
def test_over_the_wire_a_law_is_as_accurate_as_in_simulation(law: str, settings: list[str]):
    """Same delays, other noise: the largest error agrees to 2 %, at rest only noise is left."""
    record, e, _ = guided(quick(*settings), law)
    largest, static = largest_and_static(record.log, e)
    log = run(quick(*settings), law)
    expected, at_rest = largest_and_static(log, pose_error(log.X_WE_desired, log.X_WE_true))
    assert record.ended == "path"
    assert largest == pytest.approx(expected, rel=0.02)
    assert static <= 0.02 or static == pytest.approx(at_rest, rel=1e-3)
    assert record.counters["replies"] >= len(record.log.time) - 1
    assert record.counters["missing"] == 0


@pytest.mark.slow
def test_loss_doubling_overtaking_and_jitter_cost_nothing_at_rest_and_are_all_counted():
    record, e, wire = guided(quick(*(f"station.faults.{fault}" for fault in NOISE)))
    largest, static = largest_and_static(record.log, e)
    assert record.ended == "path"
    assert static <= 0.02
    assert largest < 4.0  # mm, without faults 2.46: a lost message holds the last command
    lost, counters = wire.to_client.counts, record.counters
    # What a message overtakes is late; of a lost one the number is missing; a doubled one comes twice.
    assert counters["duplicates"] + counters["late"] == pytest.approx(
        lost["doubled"] + counters["missing"] - lost["lost"], abs=12
    )
    assert counters["missing"] >= lost["lost"] - 3
    assert counters["undecodable"] == counters["foreign"] == 0


@pytest.mark.slow
def test_garbage_and_strangers_change_nothing():
    """The same run with and without them, tick by tick: the robot does not notice."""
    faults = ["station.faults.garbage=0.3", "station.faults.wrong_sender=0.3"]
    record, e, wire = guided(quick(*faults, "station.camera.position_sigma=0"))
    _, clean, _ = guided(quick("station.camera.position_sigma=0"))
    assert record.counters["undecodable"] == pytest.approx(wire.to_client.counts["garbage"], abs=1)
    assert record.counters["foreign"] == pytest.approx(wire.to_client.counts["foreign"], abs=1)
    n = min(len(e), len(clean))
    assert largest_and_static(record.log, e)[1] <= 0.02
    # The camera's noise of the orientation is left, and it is drawn alike.
    np.testing.assert_allclose(np.abs(e[:n, 3:]).max(), np.abs(clean[:n, 3:]).max(), rtol=0.02)


def motion(wire: Lockstep) -> tuple[np.ndarray, np.ndarray]:
    """Velocities (rad/s) and accelerations (rad/s^2) of the links over the whole life of a cell."""
    q = wire.cell.record().link_position
    velocity = np.diff(q, axis=0) / PERIOD
    return velocity, np.diff(velocity, axis=0) / PERIOD


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["stall_at=5", "stop_at=5"])
def test_when_the_controller_goes_the_run_ends_and_the_robot_stops_smoothly(fault: str):
    record, _, wire = guided(quick(f"station.faults.{fault}"))
    assert (
        record.ended == {"stall": "the controller fell silent", "stop_": "the controller stopped"}[fault[:5]]
    )
    assert 0.0 < record.log.time[-1] < record.log.path_end
    assert len(record.log.time) == len(record.stamps)
    wire.run_dry(500)  # two seconds in which nobody answers any more
    velocity, acceleration = motion(wire)
    assert np.abs(velocity[-50:]).max() < 1e-3
    assert (np.abs(velocity) < load_robot("irb1200").speed).all()
    assert np.abs(acceleration[SETTLED:]).max() < HARSH


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "law"),
    [
        ("stop_at=5", "numerical_ik"),
        ("stall_at=5", "pbvs"),
        ("stall_at=5", "numerical_ik"),
        ("stop_at=5", "pbvs"),
    ],
)
def test_a_run_may_go_on_where_it_was_interrupted(fault: str, law: str):
    scenario = quick(f"station.faults.{fault}", "servo.guard.resume=true")
    record, e, wire = guided(scenario, law)
    assert record.ended == "path"
    assert len(record.pauses) == 1
    assert largest_and_static(record.log, e)[1] <= 0.02
    counts = record.log.guard_counts
    assert counts["stopped"] == 1  # one tick, in which the command is taken to where the robot stands
    assert counts["resumed"] * PERIOD == pytest.approx(scenario.servo.guard.resume_time, abs=2 * PERIOD)
    _, acceleration = motion(wire)
    assert np.abs(acceleration[SETTLED:]).max() < HARSH


@pytest.mark.slow
def test_a_controller_that_does_not_come_back_ends_the_run():
    link = ("resume_within=1", "run.restart_after=-1")
    settings = ["station.faults.stop_at=5", "servo.guard.resume=true"]
    scenario = quick(*settings, *(f"station.link.{each}" for each in link))
    record, _, _ = guided(scenario)
    assert record.ended == "the controller did not come back"


@pytest.mark.slow
def test_a_station_that_is_not_there_or_another_one_is_named_before_anything_moves():
    wire = Lockstep(quick())
    wire.switch_motors_off()
    with pytest.raises(StationError, match=r"does not run EGM: waited 0\.5 s on UDP"):
        RealTimeRun(quick("station.link.connect=0.5"), "open_loop").run(wire.link, None, now=wire.now)
    wire = Lockstep(quick())
    with pytest.raises(StationError, match=r"sends every 4.032 ms, station.period is 8 ms"):
        RealTimeRun(quick("station.period=0.008", "station.drive.command_delay=0.008"), "open_loop").run(
            wire.link,
            None,
            now=wire.now,
        )


@pytest.mark.slow
def test_the_guard_of_the_simulation_is_the_guard_of_the_wire():
    record, _, _ = guided(quick("servo.guard.speed_share=0.02"))
    assert record.log.guard_counts["velocity_limit"] > 100
    assert set(record.log.guard_counts) == set(KINDS)
    limit = 0.02 * load_robot("irb1200").speed * (1.0 + 1e-6)
    assert (np.abs(record.log.velocity_command) <= limit).all()


@pytest.mark.slow
def test_a_client_that_was_held_up_too_long_says_that_it_heard_nothing():
    """The first message after that is of a robot that follows: it did not stop."""
    scenario = quick()
    wire = Lockstep(scenario)
    held_up: list[float] = []

    def hold_up() -> bool:
        if wire.cell.time > 6.0 and not held_up:
            held_up.append(wire.time)
            wire.time += 1.5 * scenario.station.link.break_after
        return False

    run = RealTimeRun(scenario, "open_loop")
    record = run.run(wire.link, wire.camera(), now=wire.now, is_asked_to_end=hold_up)
    assert record.ended == "the controller fell silent"


@pytest.mark.slow
@pytest.mark.parametrize("resume", ["false", "true"])
def test_after_a_collision_a_run_ends_by_name_and_never_goes_on(resume: str):
    """Also where runs go on after a stop, and the controller runs its program again."""
    scenario = quick(f"servo.guard.resume={resume}", "station.link.resume_within=1.5")
    wire = Lockstep(scenario)

    def hit() -> bool:
        if wire.cell.time > 6.0 and not wire.controller.has_collided:
            wire.controller.collide(wire.cell.stamp)
        return False

    run = RealTimeRun(scenario, "open_loop")
    record = run.run(wire.link, wire.camera(), now=wire.now, is_asked_to_end=hit)
    assert record.ended in ("the controller reports a collision", "the controller did not come back")
    assert wire.link.trouble == "the controller reports a collision"
    assert wire.sent[-1][0] < 6.2

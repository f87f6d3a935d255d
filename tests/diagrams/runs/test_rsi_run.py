"""A servo over RSI does what the same servo does in simulation, telegram by telegram."""

import numpy as np
import pytest

from diagrams.hardware_link import HardwareLink, StationError
from diagrams.runs.real_time import RealTimeRun
from diagrams.runs.simulation import run
from diagrams.scenario.scenario import Scenario, ScenarioError, load_scenario
from robots.description.model import load_robot
from robots.pose import pose_error
from systems.link.kuka.robot_link import KukaRobotLink, RsiCodec
from systems.link.protocols import RobotLink
from systems.link.session import LinkSession
from tests.diagrams.lockstep import Lockstep

SHORT = ["reference.acceleration=4", "reference.settle=1", "reference.dwell=0.6"]


class RsiLockstep(Lockstep):
    """A lockstep whose robot is KUKA's."""

    def new_session(self, scenario: Scenario) -> LinkSession:
        config, speed = scenario.station, load_robot(scenario.robot).speed
        codec = RsiCodec(speed, config.period, is_relative=True, name="ImFree")
        return LinkSession(codec, speed, config.link.break_after, period=config.period)

    @property
    def link(self) -> RobotLink:
        return KukaRobotLink(self)  # pyright: ignore[reportArgumentType]


def largest_error(time: np.ndarray, wanted: np.ndarray, true: np.ndarray, start: float) -> float:
    """Of the position along the path, in m."""
    return float(np.linalg.norm(pose_error(wanted, true)[time >= start, 3:], axis=1).max())


@pytest.mark.slow
def test_the_tip_is_as_far_off_its_path_as_in_simulation():
    scenario = load_scenario("cell-kuka", SHORT)
    wire = RsiLockstep(scenario)
    record = RealTimeRun(scenario, "numerical_ik").run(wire.link, wire.camera(), now=wire.now)
    assert record.ended == "path"
    assert wire.controller.counters()["late"] == 0
    log, heard = record.log, np.isfinite(record.stamps)
    X_WE, _ = wire.cell.record().at(record.stamps[heard])
    found = largest_error(log.time[heard], log.X_WE_desired[heard], X_WE, log.path_start)
    simulated = run(scenario, "numerical_ik")
    expected = largest_error(
        simulated.time, simulated.X_WE_desired, simulated.X_WE_true, simulated.path_start
    )
    # The wire is a cycle later than the simulated interface.
    assert found == pytest.approx(expected, rel=0.1)


def of_cycle(milliseconds: int) -> Scenario:
    """The cell with another cycle of RSI."""
    period = 1e-3 * milliseconds
    return load_scenario(
        "cell-kuka",
        [
            f"station.link.cycle_ms={milliseconds}",
            f"station.period={period}",
            f"station.drive.command_delay={period}",
        ],
    )


@pytest.mark.parametrize(("true", "told"), [(12, 4), (4, 12)])
def test_a_controller_with_the_other_cycle_of_rsi_is_refused(true: int, told: int):
    """The numbers of its telegrams are made of their stamps: these fit any cycle."""
    wire, scenario = RsiLockstep(of_cycle(true)), of_cycle(told)
    wire.session = wire.new_session(scenario)
    link = HardwareLink(wire.link, None, scenario, load_robot(scenario.robot), False, wire.now)
    with pytest.raises(StationError, match=rf"sends every {true}\.000 ms, station.period is {told} ms"):
        link.connect(needs_camera=False)


def follower(*settings: str) -> tuple[HardwareLink, RsiLockstep]:
    """A link that follows another one, whose last answer was followed by none."""
    scenario = load_scenario("cell-kuka", list(settings))
    wire, robot = RsiLockstep(scenario), load_robot(scenario.robot)
    first, second = (HardwareLink(wire.link, None, scenario, robot, False, wire.now) for _ in range(2))
    first.connect(needs_camera=False)
    report = first.next_report()
    assert report is not None
    first.send_command(report.position, np.zeros(6))
    return second, wire


def test_a_run_that_follows_another_waits_for_rsi_to_be_run_again():
    """Nobody answers between the two, nor while the cycle is measured, so RSI ends after ten telegrams."""
    link, wire = follower()
    link.connect(needs_camera=False)
    assert wire.controller.counters()["restarts"] == 1


def test_rsi_that_is_not_run_again_ends_the_wait_by_name():
    link, _ = follower("station.link.run.restart_after=-1", "station.link.connect=1")
    with pytest.raises(StationError, match="the controller does not run RSI: waited 1 s"):
        link.connect(needs_camera=False)


@pytest.mark.parametrize(
    ("setting", "reason"),
    [
        ("station.link.cycle_ms=5", "cycle_ms must be 4 or 12, got 5"),
        ("station.link.sentype='a b'", "sentype must be letters and digits"),
        ("station.interface=egm", "station.interface=egm contradicts station.link, which is rsi"),
        ("station.link.run.correction=both", "must be one of relative, absolute"),
    ],
)
def test_settings_that_rsi_does_not_have_are_refused(setting: str, reason: str):
    with pytest.raises(ScenarioError, match=reason):
        load_scenario("cell-kuka", [setting])


def test_a_period_that_is_no_cycle_is_refused():
    with pytest.raises(ValueError, match=r"must be the cycle of RSI, station\.link\.cycle_ms=4"):
        run(load_scenario("cell-kuka", ["station.period=0.005"]), "open_loop")

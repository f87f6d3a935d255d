"""A controller and a camera of another maker: whatever fits the protocols runs a servo."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from diagrams.record.read_record import read_record
from diagrams.record.run_record import RunRecord
from diagrams.runs.real_time import RealTimeRun
from diagrams.runs.simulation import run
from diagrams.runs.virtual_cell import Exposure, VirtualCell
from diagrams.scenario.scenario import Scenario, load_scenario
from robots.description.model import load_robot
from robots.pose import pose_error
from systems.link.clock import ClockQuality
from systems.samples import PoseSample
from systems.servo.law import LawInput, LawOutput
from systems.servo.open_loop import OpenLoop

SHORT = ["reference.path=circle", "reference.acceleration=6", "reference.settle=1", "reference.dwell=0.6"]


class Report(NamedTuple):
    seqno: int
    time: float
    position: np.ndarray
    is_ready: bool


class OwnLink:
    """The robot of a cell, without bytes: a report a cycle; a command is heard at the next one."""

    place, ports, epoch, trouble = "the next room", (0, 0), 1, ""
    utilization = 0.0

    def __init__(self, scenario: Scenario) -> None:
        self.cell = VirtualCell(scenario, load_robot(scenario.robot))
        self.references = self.following = np.full(6, np.nan), np.full(6, np.nan)
        self.exposures: list[Exposure] = []
        self.arrived, self.sent, self.velocity, self.effort = 0.0, 0, np.zeros(6), np.zeros(6)
        self.fastest = 0.0  # speed that it was sent, rad/s

    def now(self) -> float:
        return self.cell.time

    def why_not_ready(self) -> str:
        return "it sleeps"

    def poll(self, timeout: float = 0.0) -> Report:
        self.exposures += self.cell.advance(self)  # pyright: ignore[reportArgumentType]
        self.references = self.following
        joints, self.arrived = self.cell.joints, self.cell.time
        self.velocity, self.effort = joints.velocity, joints.effort
        return Report(round(self.arrived / self.cell.period), self.cell.stamp, joints.position, True)

    def send(self, position: np.ndarray, velocity: np.ndarray, is_speed_only: bool = False) -> bool:
        self.following = np.full(6, np.nan) if is_speed_only else position, velocity
        self.fastest = max(self.fastest, float(np.abs(velocity).max()))
        self.sent += 1
        return True

    @property
    def heard(self) -> float:
        return self.arrived

    @property
    def heard_stamp(self) -> float:
        return self.cell.stamp

    def stop(self, position: np.ndarray, velocity: np.ndarray, is_speed_only: bool = False) -> bool:
        return self.send(position, velocity, is_speed_only)

    def poll_aside(self) -> None: ...

    def warm_up(self) -> None: ...

    def counters(self) -> dict[str, int]:
        return {"replies": self.sent}


class OwnCamera:
    """Hands out what the camera of the cell has published."""

    def __init__(self, link: OwnLink) -> None:
        self._link = link

    def poll(self, now: float) -> PoseSample | None:
        known = [exposure for exposure in self._link.exposures if exposure.published <= now]
        self._link.exposures = self._link.exposures[len(known) :]
        return known[-1].sample if known else None

    def report(self) -> Any:
        clock = ClockQuality(0, 0.0, 0.0, 0.0, 0.0, {}, 1)
        return SimpleNamespace(counters={}, clock=clock, last_error="")


@pytest.mark.slow
def test_a_servo_runs_on_it_as_in_simulation():
    scenario = load_scenario("cell", SHORT)
    link = OwnLink(scenario)
    record = RealTimeRun(scenario, "numerical_ik").run(link, OwnCamera(link), now=link.now)
    assert record.ended == "path"
    assert record.counters["replies"] >= len(record.log.time) - 1
    log, heard = record.log, np.isfinite(record.stamps)
    X_WE, _ = link.cell.record().at(record.stamps[heard])
    over_the_link = _largest_error(log.time[heard], log.X_WE_desired[heard], X_WE, log.path_start)
    simulated = run(scenario, "numerical_ik")
    expected = _largest_error(
        simulated.time, simulated.X_WE_desired, simulated.X_WE_true, simulated.path_start
    )
    assert heard.mean() > 0.99
    assert over_the_link == pytest.approx(expected, rel=0.05)


class Breaks(OpenLoop):
    """A law with a defect that shows itself on the way."""

    error: type[BaseException] = ZeroDivisionError

    def step(self, moment: LawInput, memory: np.ndarray) -> LawOutput:
        if np.abs(moment.V_WD).max() > 0.2:  # in full motion
            raise self.error("of the law")
        return super().step(moment, memory)


class Interrupted(Breaks):
    error = KeyboardInterrupt


@pytest.mark.slow
@pytest.mark.parametrize("law", [Breaks, Interrupted])
def test_a_law_that_breaks_on_the_way_leaves_the_robot_at_rest_and_the_record_whole(
    law: type[Breaks], tmp_path: Path
):
    scenario = load_scenario("cell", SHORT)
    link, record = OwnLink(scenario), RunRecord(tmp_path / "broken.mcap", "")
    with pytest.raises(law.error, match="of the law"):
        RealTimeRun(scenario, law).run(link, OwnCamera(link), now=link.now, record=record)
    assert link.fastest > 0.1
    np.testing.assert_allclose(link.following[1], 0.0, atol=1e-12)
    contents = read_record(tmp_path / "broken.mcap")
    assert contents.is_complete
    assert contents.run["ended"] == f"{law.error.__name__}: of the law"
    assert len(contents.topics["/joint_sample"].time) > 1.0 / scenario.station.period


def _largest_error(time: np.ndarray, wanted: np.ndarray, true: np.ndarray, start: float) -> float:
    """Of the position along the path, in m."""
    return float(np.linalg.norm(pose_error(wanted, true)[time >= start, 3:], axis=1).max())

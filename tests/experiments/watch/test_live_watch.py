"""A running cell that is watched from beside: what would be allowed to a robot that somebody else moves."""

import json
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from diagrams.hardware_link import StationError
from diagrams.scenario.scenario import load_scenario
from experiments.watch.live import ADVICE, Decision, LiveWatch
from experiments.watch.run import WatchRun
from robots.description.model import load_robot
from systems.link.udp_channel import UdpChannel
from systems.samples import Person, PersonSample
from systems.vision.people.shared_watch import SharedWatch
from tests.experiments.commands import refusal, truetip
from tests.experiments.station.test_endings import PATIENCE, started

SCENARIO = load_scenario("cell-watched", ["station.kind=egm", "servo.people.hull.edge=0.2"])
ROBOT = load_robot("irb1200")
NEAR = Person(1, np.array([[0.5, 0.0, 0.6]]), 0.04, np.zeros(3))  # within the arm's reach
ENDING = ["--duration", "90", "--json", "watch.json", "--report", "watch.html"]
EVERY, LATE = 0.1, 0.08  # s, between images and until people are known in them


class Clock:
    """A controller that speaks every 4 ms, and somebody who looks, by a clock that runs while one waits."""

    place = "UDP 127.0.0.1:6510"

    def __init__(self, near: tuple[float, float] = (np.inf, np.inf), silent: float = np.inf) -> None:
        self.time, self.arrived, self.velocity = 100.0, 0.0, np.zeros(6)
        self.shared, self.problem, self.seen = SharedWatch(), "", None
        self._near, self._silent, self._looked = near, silent, -np.inf
        self.has_ended = False

    @property
    def since(self) -> float:
        return self.time - self.shared.origin if self.shared.origin else -1.0

    def poll(self, timeout: float) -> Any:
        self.time += min(timeout, 4e-3)
        if self.since > self._silent:
            return None
        self.arrived = self.time
        return SimpleNamespace(position=np.zeros(6))

    def now(self) -> float:
        exposed = self.time - LATE
        if exposed >= self._looked + EVERY and self.arrived > exposed:
            self._looked = exposed
            people = (NEAR,) if self._near[0] <= exposed - self.shared.origin < self._near[1] else ()
            self.shared.publish(PersonSample(exposed, True, people), 0.0)
        return self.time

    def end(self) -> None:
        self.has_ended = True


def watched(cell: Any, seconds: float, tell: Any = lambda decision: None) -> tuple[WatchRun, LiveWatch]:
    live = LiveWatch(SCENARIO, ROBOT, cell, tell, lambda time: time >= seconds, cell.now)
    return live.run(cell, empty=2), live


def test_who_is_within_the_margins_of_the_robot_is_at_it_not_behind_it():
    assert Decision(1.0, -0.01, 1.9, 0.0, "stop", 0.1).text == (
        "1.0 s: stop, somebody at the robot, 0 % of the speed, images are 0.1 s old"
    )


def test_a_stop_is_advised_while_somebody_is_near_and_nobody_has_to_acknowledge_it():
    told: list[Decision] = []
    cell = Clock(near=(2.0, 3.0))
    run, live = watched(cell, 5.0, told.append)
    line = run.timeline
    assert run.stops == 1
    begun, ended = line.time[line.stopped][[0, -1]]
    latest = EVERY + LATE + SCENARIO.servo.separation.period
    assert 2.0 + LATE <= begun <= 2.0 + latest
    assert 3.0 + LATE <= ended <= 3.0 + latest
    assert (line.rate[line.stopped] == 0.0).all()
    assert (line.rate[line.time > 3.5] == 1.0).all()
    assert [each.zone for each in told if each.zone == "stop"]
    assert ADVICE in run.notes
    assert cell.has_ended
    assert not live.problem


def test_a_controller_that_falls_silent_ends_in_a_stop_for_images_that_cannot_be_used():
    run, _ = watched(Clock(silent=2.0), 5.0)
    line, limits = run.timeline, SCENARIO.servo.separation
    assert any(note.startswith("the controller fell silent at 2.") for note in run.notes)
    assert line.stopped[line.time > 2.0 + limits.stop_after + EVERY].all()
    assert not line.stopped[line.time < 2.0 + limits.slow_after].any()


def test_what_never_speaks_or_never_looks_is_told_and_a_process_that_ends_ends_the_watch():
    dumb = Clock()
    dumb.poll = lambda timeout: setattr(dumb, "time", dumb.time + timeout)  # type: ignore[method-assign]
    with pytest.raises(
        StationError, match=r"no message of a controller came in: waited 10 s on UDP 127\.0\.0\.1"
    ):
        watched(dumb, 5.0)
    assert dumb.has_ended
    blind = Clock()
    blind.problem = "camera 2 has no stream"
    with pytest.raises(StationError, match="nobody looks for people: camera 2 has no stream"):
        watched(blind, 5.0)
    gone = Clock()

    def tell(decision: Decision) -> None:
        if decision.time > 1.0:
            gone.problem = "camera 2 has another size"

    run, live = watched(gone, 5.0, tell)
    assert live.problem.endswith("s: camera 2 has another size")
    assert run.timeline.time[-1] < 1.1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--station", "egm", "--images", "x"], "leave out --study and --images"),
        (["--with-cell", "--study"], "leave out --study and --images"),
        (["--duration", "3"], "--duration is of a running cell"),
        (["--duration", "0", "--with-cell"], "--duration must be positive, got 0"),
        (["--with-cell", "--station", "simulated"], "--with-cell needs --station egm or rsi"),
        (
            ["--scenario", "cell", "--station", "egm"],
            "takes images of the whole cell; use --scenario cell-watched",
        ),
    ],
)
def test_what_cannot_be_watched_is_refused_in_one_line(arguments: list[str], message: str, tmp_path: Path):
    assert message in refusal(truetip("watch", *arguments, "--report", tmp_path / "watch.html"))
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.parametrize("station", ["egm", "rsi"])
def test_a_virtual_cell_is_watched_until_ctrl_c_which_leaves_the_report(station: str, tmp_path: Path):
    process, _ = started(tmp_path, "watch", "--with-cell", "--station", station, *ENDING)
    numbers = ended_after_decision(process, tmp_path)
    assert numbers["duration_s"] >= 0.0
    assert ADVICE in numbers["notes"]
    assert "Plan of the cell" in (tmp_path / "watch.html").read_text()


@pytest.mark.slow
@pytest.mark.real_time
def test_a_cell_of_another_terminal_is_watched_with_the_images_that_its_cameras_send(tmp_path: Path):
    """Reports over UDP, images over HTTP; both programs share nothing else."""
    wire = ["--set", f"station.link.port={free_port()}", "--set", "station.overview.delay=0.1"]
    base = [
        sys.executable,
        "-m",
        "experiments.main",
        "cell",
        "--scenario",
        "cell-watched",
        "--show-images",
        "0",
    ]
    moves = ["--set", "station.link.run.streams=true", "--announce", "--until-eof"]
    # It ends when its input closes, which it does with this block.
    with subprocess.Popen(
        [*base, *wire, *moves],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as cell:
        assert cell.stdout is not None
        source = f"http://127.0.0.1:{json.loads(cell.stdout.readline())['image_port']}/{{camera}}"
        arguments = ["--station", "egm", *wire, "--set", f"station.overview.source={source}"]
        process, _ = started(tmp_path, "watch", *arguments, *ENDING)
        numbers = ended_after_decision(process, tmp_path)
    assert cell.returncode == 0
    assert any(note.endswith("sets of images") for note in numbers["notes"])


def ended_after_decision(process: subprocess.Popen, folder: Path) -> dict[str, Any]:
    """The numbers of a watch that gets Ctrl-C after it has begun to say what would be allowed."""
    assert process.stdout is not None
    said = []
    for line in process.stdout:
        said.append(line)
        if "of the speed" in line:
            process.send_signal(signal.SIGINT)
            break
    _, problem = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, (said, problem)
    return json.loads((folder / "watch.json").read_text())


def free_port() -> int:
    with UdpChannel(0) as channel:
        return channel.address[1]

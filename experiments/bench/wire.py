"""Response time of the servo to a controller, beside an echo: ``python -m experiments.bench.wire [MINUTES]``.

``python -m experiments.bench.wire learning`` compares a law that learns with one that does not: both, twice,
in turn on the same wire, beside the same echo.

A virtual cell and the servo run in real time; at the same time a metronome sends a controller's messages to
three echoes on the same machine. One does what the smallest client of EGM does, written with a package of
others (ABBRobotEGM): decode, answer with the joints that came. The second does the same as awake as the servo
is, in the servo's own receive loop. The third sends the bytes back as they are. All are timed alike, from the
moment at which a message can be read to the reply's departure. A cycle is missed when its message is not
answered before the next one is there. Where the machine held up the sender, which then catches up, the next
one comes too soon for any answer: such misses are counted apart.

On a machine that does other work, too, ``chrt -r 10 python -m experiments.bench.wire`` measures what the
parts do, and not who else had the processor: all of them inherit the priority.
"""

import itertools
import json
import os
import select
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np

from diagrams.hardware_link import HardwareLink
from diagrams.runs.undisturbed import undisturbed
from diagrams.scenario.scenario import load_scenario
from experiments.station.guided import compare_on_station
from robots.description.model import NUM_JOINTS, load_robot
from systems.link.abb.controller import EgmRunConfig, VirtualController
from systems.link.abb.messages import decode_report
from systems.link.clock import steady_time
from systems.link.udp_channel import UdpChannel

LAW = "numerical_ik"
LEARNING, NOT_LEARNING, TURNS = "self_calibrating", "open_loop", 2
ALLOWED_LEARNING = 0.1  # ms, that a law may answer later because it learns
PERIOD = 4.032e-3  # s
# A machine that stands still for a moment shall cost cycles, not end the run, and neither shall a robot that
# waits at its start for minutes.
PATIENT = [
    "station.link.break_after=5",
    "station.link.run.timeout=5",
    "station.link.run.condition_time=3600",
    "servo.guard.stop_after=10",
]
ALLOWED, ALLOWED_LATE = 0.5, 4.032  # ms, median and 99 %
ALLOWED_RATIO, ALLOWED_AWAKE = 4.0, 2.2

Row = tuple[str, str, float, str, float, str]


@dataclass(frozen=True)
class TurnAround:
    """Response times of a client."""

    median: float  # ms
    late: float  # ms, 99 %
    missed: int  # messages that were not answered before the next one came
    excused: int = 0  # further ones, whose next one came in less than half a cycle


def wire(minutes: float = 0.0) -> Iterator[Row]:
    """The benchmark's rows: turn-around of the servo against the echoes and what is allowed."""
    servo, echo, awake, plain = turn_arounds(minutes)
    text = f"{LAW} over EGM: turn-around"
    yield "turn_around", text, servo.median, "ms", ALLOWED_RATIO * echo.median, "4 EGM echoes"
    yield "turn_around_awake", text, servo.median, "ms", ALLOWED_AWAKE * awake.median, "2.2 awake echoes"
    yield "turn_around_median", f"{text}, median", servo.median, "ms", ALLOWED, "allowed"
    yield "turn_around_99", f"{text}, 99 %", servo.late, "ms", ALLOWED_LATE, "allowed"
    yield "turn_around_plain", f"{text}", servo.median, "ms", plain.median, "plain echo"
    text = f"{LAW} over EGM: missed (excused {servo.excused}, echo {echo.excused})"
    yield "missed_cycles", text, float(servo.missed), "", 1.0 + echo.missed, "echo + 1"


def turn_arounds(minutes: float = 0.0) -> tuple[TurnAround, TurnAround, TurnAround, TurnAround]:
    """Servo, EGM, awake and plain echo over the same time: one path, or as many minutes as are wanted."""
    settle = [f"reference.settle={60.0 * minutes}"] if minutes else []
    scenario = load_scenario("cell", ["station.kind=egm", *PATIENT, *settle])
    with ExitStack() as stack:
        echoes = [stack.enter_context(_Echo(kind)) for kind in ("egm", "awake", "plain")]
        comparison = compare_on_station(scenario, load_robot(scenario.robot), [LAW], with_cell=True)
        found = [echo.finish() for echo in echoes]
    record = comparison.records[LAW][0]
    if record.ended != "path":
        raise RuntimeError(f"the run did not come to its end: {record.ended}")
    times = 1e3 * record.turn_around
    missed, excused = missed_ticks(record.stamps, np.array(comparison.cell["crowded_at"]))
    servo = TurnAround(float(np.median(times)), float(np.percentile(times, 99)), missed, excused)
    return servo, found[0], found[1], found[2]


def learning() -> Iterator[Row]:
    """Rows of a law that learns beside one that does not."""
    scenario = load_scenario("cell", [*PATIENT, "station.kind=egm", "reference.settle=3"])
    with ExitStack() as stack:
        echo = stack.enter_context(_Echo("egm"))
        laws = [NOT_LEARNING, LEARNING] * TURNS
        comparison = compare_on_station(scenario, load_robot(scenario.robot), laws, with_cell=True)
        answered = echo.finish()
    crowded, found = np.array(comparison.cell["crowded_at"]), {}
    for law, records in comparison.records.items():
        ended = {record.ended for record in records}
        if ended != {"path"}:
            raise RuntimeError(f"{law}: a run did not come to its end: {', '.join(ended)}")
        times = 1e3 * np.concatenate([record.turn_around for record in records])
        missed = [missed_ticks(record.stamps, crowded)[0] for record in records]
        found[law] = TurnAround(float(np.median(times)), float(np.percentile(times, 99)), sum(missed))
        yield f"turn_around_{law}", f"{law}, median", found[law].median, "ms", answered.median, "EGM echo"
        yield f"turn_around_99_{law}", f"{law}, 99 %", found[law].late, "ms", answered.late, "EGM echo"
        yield f"missed_{law}", f"{law}, missed", float(sum(missed)), "", float(answered.missed), "EGM echo"
    later = found[LEARNING].median - found[NOT_LEARNING].median
    text = f"{LEARNING}: later than {NOT_LEARNING}, median"
    yield "turn_around_learning", text, later, "ms", ALLOWED_LEARNING, "allowed"


def missed_ticks(stamps: np.ndarray, crowded_at: np.ndarray) -> tuple[int, int]:
    """How many ticks passed without an answer, and how many more of them the controller left no time for.

    Args:
        stamps: of the messages that were answered, at each tick, NaN where none was, shape (n,), s.
        crowded_at: stamps of the messages that came in less than half a cycle after the one before, s.
    """
    answered = np.flatnonzero(np.isfinite(stamps))
    missed = np.diff(answered) - 1
    # What took the place of the last one that was missed is the one that was answered next.
    came_next, missed = stamps[answered[1:]][missed > 0], missed[missed > 0]
    nearest = np.abs(came_next[:, None] - crowded_at[None]).min(axis=1, initial=np.inf)
    is_excused = nearest < 0.25 * PERIOD
    return int(missed[~is_excused].sum()), int(missed[is_excused].sum())


class _Echo:
    """An echo and its metronome, in processes of their own."""

    def __init__(self, kind: str) -> None:
        self._kind = kind

    def __enter__(self) -> "_Echo":
        def start(*words: str) -> subprocess.Popen:
            command = [sys.executable, "-m", "experiments.bench.wire", *words]
            return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

        self._echo = start("echo", self._kind)
        assert self._echo.stdout is not None
        port = self._echo.stdout.readline().strip()
        self._metronome = start("metronome", port)
        return self

    def finish(self) -> TurnAround:
        """Ends it and says how it was."""
        crowded, _ = self._metronome.communicate("")
        output, _ = self._echo.communicate(timeout=30.0)
        median, late, overtaken_by = json.loads(output)
        excused = len(set(overtaken_by) & set(json.loads(crowded)))
        return TurnAround(median, late, len(overtaken_by) - excused, excused)

    def __exit__(self, *_: object) -> None:
        for process in (self._metronome, self._echo):
            process.kill()


def _echo(kind: str) -> None:
    """Answers until it is told to stop, then prints median and 99 % in ms, and what came too soon."""
    if kind == "awake":
        _awake_echo()
        return
    answer, channel = _egm_answer() if kind == "egm" else _plain_answer()
    print(channel.getsockname()[1], flush=True)
    times, overtaken_by = [], []
    while (answered := answer()) is not None:
        number, started = answered
        times.append(steady_time() - started)
        if select.select([channel], [], [], 0.0)[0]:
            overtaken_by.append(number + 1)
    print(json.dumps([*(1e3 * np.percentile(times[20:], [50, 99])), overtaken_by]))


@undisturbed()
def _awake_echo() -> None:
    """As `_echo`, by the receive loop of the servo, which does not sleep when a message is due."""
    scenario = load_scenario("cell", ["station.kind=egm", *PATIENT])
    robot, link = load_robot(scenario.robot), scenario.station.link
    with link.open(robot, link.wire(PERIOD, any_port=True)) as client:
        loop = HardwareLink(client, None, scenario, robot, False)
        print(client.ports[0], flush=True)
        times, overtaken_by, last = [], [], None
        while (report := loop.next_report(wait=60.0 if last is None else 2.0, prepare=_nothing)) is not None:
            if client.send(report.position, np.zeros(NUM_JOINTS)):
                times.append(steady_time() - loop.arrived)
            if last is not None and report.seqno > last + 1:
                overtaken_by.append(report.seqno)
            last = report.seqno
    print(json.dumps([*(1e3 * np.percentile(times[20:], [50, 99])), overtaken_by]))


def _nothing() -> None:
    """An echo has nothing to prepare but its link."""


def _egm_answer() -> tuple[Callable[[], tuple[int, float] | None], Any]:
    from ABBRobotEGM import EGM

    client = EGM(port=0)
    channel = client.socket
    assert channel is not None

    def answer() -> tuple[int, float] | None:
        select.select([channel], [], [])
        started = steady_time()
        ok, state = client.receive_from_robot(0.0)
        if not ok or state is None or state.header.tm == 0:
            return None
        client.send_to_robot(state.joint_angles)
        return state.header.seqno, started

    return answer, channel


def _plain_answer() -> tuple[Callable[[], tuple[int, float] | None], Any]:
    channel = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    channel.bind(("127.0.0.1", 0))
    numbers = itertools.count(1)

    def answer() -> tuple[int, float] | None:
        select.select([channel], [], [])
        started = steady_time()
        data, sender = channel.recvfrom(65536)
        if len(data) < 10:
            return None
        channel.sendto(data, sender)
        return next(numbers), started

    return answer, channel


def _metronome(port: int) -> None:
    """Sends messages of a robot that stands until its input ends, then one that says stop.

    Prints the numbers of those that left less than half a cycle after the one before.
    """
    robot = load_robot("irb1200")
    controller, still = VirtualController(robot, EgmRunConfig()), np.zeros(6)
    os.set_blocking(sys.stdin.fileno(), False)
    with UdpChannel() as channel:
        start, cycle, crowded = steady_time(), 0, []
        sent = start
        while sys.stdin.buffer.read() is None:
            cycle += 1
            data = controller.report(1.0 + cycle * PERIOD, still, still, still)
            time.sleep(max(0.0, start + cycle * PERIOD - steady_time()))
            channel.send(data, ("127.0.0.1", port))
            before, sent = sent, steady_time()
            if sent - before < 0.5 * PERIOD:
                crowded.append(decode_report(data).seqno)
            channel.receive()
        # A message at the controller's time zero ends the echoes: none of its own has that.
        time.sleep(0.1)
        channel.send(b"", ("127.0.0.1", port))
        print(json.dumps(crowded))


def main() -> None:
    """Prints the rows, or plays one of the parts."""
    words = sys.argv[1:]
    if words[:1] == ["echo"]:
        _echo(words[1])
    elif words[:1] == ["metronome"]:
        _metronome(int(words[1]))
    else:
        rows = learning() if words == ["learning"] else wire(float(words[0]) if words else 0.0)
        for name, text, value, unit, yardstick, against in rows:
            print(f"{name:32s} {text:48s} {value:8.3f} {unit:3s} {against} {yardstick:.3f} {unit}")
        policy, (load, *_) = os.sched_getscheduler(0), os.getloadavg()
        kind = {os.SCHED_FIFO: "SCHED_FIFO", os.SCHED_RR: "SCHED_RR"}.get(policy, "no real-time priority")
        print(f"{kind}, load {load:.1f} on {os.cpu_count()} processors")


if __name__ == "__main__":
    main()

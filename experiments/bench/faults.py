"""What happens when a process of the cell stands still or dies: ``python -m experiments.bench.faults``.

A client guides a virtual cell over loopback, its camera behind a relay, three processes that share nothing
but their ports. Two seconds into the path one of them is stopped for a second, killed, or killed and started
again; the run shall end, or go on. For each of the 18 cases the table says how the client ended, how much its
record holds, and how near the robot came to its limits of speed and acceleration, in the commands of the
record and in the true motion of the links. It takes about ten minutes, in real time; words choose cases:
``faults cell kill``.
"""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from diagrams.record.read_record import read_record
from diagrams.runs.virtual_cell import CellRecord
from experiments.cli.console import progress_bar
from robots.description.model import RobotModel, load_robot

WHO, WHAT, THEN = ("client", "cell", "camera"), ("stop 1 s", "kill", "restart"), ("end", "resume")
_SCENARIO = "cell"
_QUICK = ["reference.path=circle", "reference.acceleration=1", "reference.settle=1", "reference.dwell=1"]
_PERIOD = 4.032e-3  # s
_ON_PATH, _STOPPED = 2.0, 1.0  # s, of the path when it happens; and how long a process stands still
_PATIENCE = 60.0  # s
_AT_REST = 1e-3  # rad/s


@dataclass
class Outcome:
    """How a case ended. Shares are of the robot's limits, 1 where one is reached; NaN where nobody saw it."""

    ended: str  # what the client said last, or its exit code
    recorded: float  # s of the path that its record holds
    commands: tuple[float, float]  # shares of speed and acceleration in the commands of its records
    links: tuple[float, float]  # the same of the true links
    at_rest: bool | None  # whether the true robot stands at the end


class Case:
    """Three processes, one of which comes to harm."""

    def __init__(self, folder: Path, who: str, what: str, then: str) -> None:
        self._folder, self._who, self._what, self._then = folder, who, what, then
        self._port = _free_port()
        self._runs = 0

    def run(self) -> Outcome:
        """Runs it and looks at what is left."""
        self._processes: dict[str, subprocess.Popen] = {}
        try:
            self._start("cell")
            self._start("camera")
            self._start("client")
            self._wait_for_path()
            self._harm()
            said = self._client_end()
            time.sleep(2.0)  # in which a robot that nobody guides any more comes to rest
            self._end("cell")
        finally:
            for process in self._processes.values():
                process.kill()
                process.communicate()
        return self._outcome(said)

    def _start(self, who: str) -> None:
        pipe = subprocess.PIPE
        command = {"cell": self._cell, "camera": self._relay, "client": self._client}[who]()
        process = subprocess.Popen(
            command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, start_new_session=True
        )
        self._processes[who] = process
        if who != "client":
            assert process.stdout is not None
            line = process.stdout.readline()
            port = int(json.loads(line)["camera_port"])
            if who == "cell":
                self._camera_port = port
            else:
                self._relay_port = port

    def _cell(self) -> list[str]:
        truth = ["--truth", str(self._folder / "truth.npz")]
        # The camera keeps its port, as a real one does.
        ports = [
            f"station.link.port={self._port}",
            f"station.link.camera.server.port={getattr(self, '_camera_port', 0)}",
        ]
        return [*_truetip("cell", ports), "--announce", "--until-eof", *truth]

    def _relay(self) -> list[str]:
        return [
            sys.executable,
            "-m",
            __spec__.name,
            "relay",
            str(self._camera_port),
            str(getattr(self, "_relay_port", 0)),
        ]

    def _client(self) -> list[str]:
        self._runs += 1
        settings = [
            f"station.link.port={self._port}",
            "station.link.camera.server.transport=tcp",
            f"station.link.camera.server.port={self._relay_port}",
            "station.link.resume_within=30",
            f"servo.guard.resume={str(self._then == 'resume').lower()}",
        ]
        out = ["--law", "numerical_ik", "--station", "egm", "--out", str(self._folder / f"run{self._runs}")]
        return [*_truetip("run", [*_QUICK, *settings]), *out]

    def _records(self) -> list[Path]:
        return sorted(self._folder.glob("run*/*.mcap"))

    def _wait_for_path(self) -> None:
        deadline = time.monotonic() + _PATIENCE
        while not self._records() or _seconds(self._records()[-1]) < _ON_PATH:
            if time.monotonic() > deadline or self._processes["client"].poll() is not None:
                raise RuntimeError(f"the client did not come to its path: {self._client_end()}")
            time.sleep(0.1)

    def _harm(self) -> None:
        process = self._processes[self._who]
        if self._what == "stop 1 s":
            process.send_signal(signal.SIGSTOP)
            time.sleep(_STOPPED)
            process.send_signal(signal.SIGCONT)
            return
        process.kill()
        process.communicate()
        if self._what == "restart":
            time.sleep(0.3 if self._who != "client" else 1.0)
            self._start(self._who)

    def _client_end(self) -> str:
        client = self._processes["client"]
        try:
            _, said = client.communicate(timeout=_PATIENCE)
        except subprocess.TimeoutExpired:
            client.send_signal(signal.SIGTERM)
            _, said = client.communicate(timeout=_PATIENCE)
        lines = [line.removeprefix("truetip: ") for line in said.splitlines() if line.startswith("truetip: ")]
        return f"{client.returncode}: {lines[-1] if lines else 'its path is over'}"

    def _end(self, who: str) -> None:
        process = self._processes[who]
        with suppress(subprocess.TimeoutExpired, ValueError):
            process.communicate(timeout=_PATIENCE)  # closes its standard input, which ends it

    def _outcome(self, said: str) -> Outcome:
        robot = load_robot("irb1200")
        shares, recorded = [], 0.0
        for path in self._records():
            topics = read_record(path).topics
            recorded += float(topics["/command"].time[-1])
            # By the controller's clock: that of the path stands still while nothing is heard.
            joints, command = topics["/joint_sample"], topics["/command"]
            _, of_joints, of_command = np.intersect1d(joints.time, command.time, return_indices=True)
            stamps = joints.columns["stamp"][of_joints, 0].astype(float)
            shares.append(_shares(robot, stamps, command.columns["position"][of_command]))
        links, at_rest = (np.nan, np.nan), None
        truth = self._folder / "truth.npz"
        if truth.exists():
            record = CellRecord.load(truth)
            links = _shares(robot, record.time, record.link_position)
            last = np.diff(record.link_position[-50:], axis=0) / _PERIOD
            at_rest = bool(np.abs(last).max() < _AT_REST)
        commands = np.max(shares, axis=0) if shares else (np.nan, np.nan)
        return Outcome(said, recorded, (float(commands[0]), float(commands[1])), links, at_rest)


def _shares(robot: RobotModel, time: np.ndarray, q: np.ndarray) -> tuple[float, float]:
    """Largest shares of the limits of speed and acceleration in positions (n, 6) at times (n,) in s."""
    known = np.isfinite(q).all(axis=1)
    time, q = time[known], q[known]
    h = np.diff(time)
    velocity = np.diff(q, axis=0) / h[:, None]
    # Where messages are missing the speed between is a mean; an acceleration is that of neighbours only.
    near = (h[1:] < 1.5 * _PERIOD) & (h[:-1] < 1.5 * _PERIOD)
    acceleration = np.diff(velocity, axis=0)[near] / (0.5 * (h[1:] + h[:-1]))[near, None]
    return (
        float((np.abs(velocity) / robot.speed).max()),
        float((np.abs(acceleration) / robot.acceleration).max()),
    )


def _seconds(path: Path) -> float:
    """Of the path, that a record holds so far."""
    try:
        topic = read_record(path).topics.get("/command")
    except ValueError:  # nothing has been flushed yet
        return 0.0
    return float(topic.time[-1]) if topic is not None and len(topic.time) else 0.0


def _truetip(command: str, settings: list[str]) -> list[str]:
    pairs = [word for setting in settings for word in ("--set", setting)]
    return [sys.executable, "-m", "experiments.main", command, "--scenario", _SCENARIO, *pairs]


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def _relay_main(target: int, port: int) -> None:
    """Passes a TCP connection on to a port of this machine, and back, until standard input closes."""
    listener = socket.create_server(("127.0.0.1", port))
    sys.stdout.write(json.dumps({"camera_port": listener.getsockname()[1]}) + "\n")
    sys.stdout.flush()

    def pump(source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                sink.sendall(data)
        for end in (source, sink):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def accept() -> None:
        while True:
            here, _ = listener.accept()
            there = socket.create_connection(("127.0.0.1", target))
            for ends in ((here, there), (there, here)):
                threading.Thread(target=pump, args=ends, daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()
    sys.stdin.read()


def main(chosen: list[str]) -> None:
    """Runs the cases whose words are all among the arguments, or all of them, and prints the table."""
    cases = [case for case in product(WHO, WHAT, THEN) if set(chosen) <= set(" ".join(case).split())]
    table = Table(box=box.SIMPLE_HEAD)
    for name in ("who", "what", "then", "the client ended with", "recorded", "commands", "links", "at rest"):
        table.add_column(name, overflow="fold")
    with progress_bar(f"{len(cases)} cases in real time") as progress:
        for number, case in enumerate(cases):
            with tempfile.TemporaryDirectory(prefix="truetip-faults-") as folder:
                outcome = Case(Path(folder), *case).run()
            at_rest = {True: "yes", False: "NO", None: "-"}[outcome.at_rest]
            shares = [
                "/".join(f"{share:.2f}" for share in pair) for pair in (outcome.commands, outcome.links)
            ]
            table.add_row(*case, outcome.ended, f"{outcome.recorded:.1f} s", *shares, at_rest)
            progress((number + 1) / len(cases))
    Console(width=None if sys.stdout.isatty() else 160).print(table)
    print("commands and links: largest shares of the limits of speed / acceleration")


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    if sys.argv[1:2] == ["relay"]:
        _relay_main(int(sys.argv[2]), int(sys.argv[3]))
    else:
        main(sys.argv[1:])

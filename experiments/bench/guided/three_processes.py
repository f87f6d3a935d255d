"""A cell, its camera behind a relay and a client that guides it, in three processes over loopback."""

import json
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from diagrams.record.read_record import read_record
from diagrams.runs.virtual_cell import CellRecord
from diagrams.scenario.scenario import load_scenario
from diagrams.servo import law_config
from robots.description.model import RobotModel, load_robot
from systems.servo import LAWS

CIRCLE = ("reference.path=circle", "reference.acceleration=1", "reference.settle=1", "reference.dwell=4")
_SCENARIO = "cell"
_PERIOD = 4.032e-3  # s
_ON_PATH = 2.0  # s, of the path, where it is waited for
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

    def cells(self) -> tuple[str, ...]:
        """Of a table: how it ended, both pairs of shares, and whether the robot stands."""
        shares = ("/".join(f"{share:.2f}" for share in pair) for pair in (self.commands, self.links))
        return self.ended, *shares, {True: "yes", False: "NO", None: "-"}[self.at_rest]


class ThreeProcesses:
    """They share nothing but their ports; what is left of them at the end of the block is killed."""

    def __init__(
        self,
        folder: Path,
        path: tuple[str, ...] = CIRCLE,
        resumes: bool = False,
        patience: float = _PATIENCE,
        with_truth: bool = True,
        law: str = "numerical_ik",
        faults: str = "",
    ) -> None:
        """Starts nothing.

        Args:
            folder: for records and the truth.
            path: settings of the client's scenario.
            resumes: whether the client goes on after a stop.
            patience: s, in which everything comes to its end.
            with_truth: whether the cell notes the true motion, for which its memory grows.
            law: of the client.
            faults: of the cell's wire, as ``truetip cell --faults`` takes them.
        """
        self._has_truth, self._law, self._faults = with_truth, law, faults
        self._sends_speeds = law_config(load_scenario(_SCENARIO), LAWS.find(law)).drive == "velocity"
        self.folder, self._path, self._resumes, self._patience = folder, path, resumes, patience
        self.port, self.camera_port, self.relay_port = _free_port(), 0, 0
        self.processes: dict[str, subprocess.Popen] = {}
        self._runs = 0

    def __enter__(self) -> "ThreeProcesses":
        for who in ("cell", "camera", "client"):
            self.start(who)
        return self

    def __exit__(self, *_: object) -> None:
        for process in self.processes.values():
            process.kill()
            process.communicate()

    def start(self, who: str) -> None:
        """Starts one of them: the cell, the relay before its camera, or the client."""
        pipe = subprocess.PIPE
        command = {"cell": self._cell, "camera": self._relay, "client": self._client}[who]()
        process = subprocess.Popen(
            command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, start_new_session=True
        )
        self.processes[who] = process
        if who != "client":
            assert process.stdout is not None
            line = process.stdout.readline()
            port = int(json.loads(line)["camera_port"])
            if who == "cell":
                self.camera_port = port
            else:
                self.relay_port = port

    def _cell(self) -> list[str]:
        truth = ["--truth", str(self.folder / "truth.npz")] if self._has_truth else []
        # The camera keeps its port, as a real one does.
        ports = [
            f"station.link.port={self.port}",
            f"station.link.camera.server.port={self.camera_port}",
        ]
        faults = ["--faults", self._faults] if self._faults else []
        return [*_truetip("cell", ports), "--announce", "--until-eof", *truth, *faults]

    def _relay(self) -> list[str]:
        return [
            sys.executable,
            "-m",
            __spec__.name,
            str(self.camera_port),
            str(self.relay_port),
        ]

    def _client(self) -> list[str]:
        self._runs += 1
        settings = [
            f"station.link.port={self.port}",
            "station.link.camera.server.transport=tcp",
            f"station.link.camera.server.port={self.relay_port}",
            "station.link.resume_within=30",
            f"servo.guard.resume={str(self._resumes).lower()}",
        ]
        out = ["--law", self._law, "--station", "egm", "--out", str(self.folder / f"run{self._runs}")]
        return [*_truetip("run", [*self._path, *settings]), *out]

    def records(self) -> list[Path]:
        """Of its runs so far."""
        return sorted(self.folder.glob("run*/*.mcap"))

    def wait_for_path(self) -> None:
        """Until the robot is two seconds on its path. Raises RuntimeError if it does not come there."""
        deadline = time.monotonic() + _PATIENCE
        while not self.records() or _seconds(self.records()[-1]) < _ON_PATH:
            if time.monotonic() > deadline or self.processes["client"].poll() is not None:
                raise RuntimeError(f"the client did not come to its path: {self.client_end()}")
            time.sleep(0.1)

    def client_end(self) -> str:
        """Waits for the client's end; its exit code and what it said last."""
        client = self.processes["client"]
        try:
            _, said = client.communicate(timeout=self._patience)
        except subprocess.TimeoutExpired:
            client.send_signal(signal.SIGTERM)
            _, said = client.communicate(timeout=self._patience)
        lines = [line.removeprefix("truetip: ") for line in said.splitlines() if line.startswith("truetip: ")]
        return f"{client.returncode}: {lines[-1] if lines else 'its path is over'}"

    def has_ended(self, who: str) -> bool:
        """Whether its process is over."""
        return self.processes[who].poll() is not None

    def stopped_client_end(self) -> str:
        """Of a client that is told to stop."""
        self.processes["client"].send_signal(signal.SIGTERM)
        return self.client_end()

    def end(self, who: str) -> None:
        """Ends one of them as its parent would."""
        process = self.processes[who]
        with suppress(subprocess.TimeoutExpired, ValueError):
            process.communicate(timeout=self._patience)  # closes its standard input, which ends it

    def outcome(self, said: str) -> Outcome:
        """What the records and the truth of the cell say; ``said`` of `client_end`."""
        robot = load_robot("irb1200")
        shares, recorded = [], 0.0
        for path in self.records():
            topics = read_record(path).topics
            recorded += float(topics["/command"].time[-1])
            # By the controller's clock: that of the path stands still while nothing is heard.
            joints, command = topics["/joint_sample"], topics["/command"]
            _, of_joints, of_command = np.intersect1d(joints.time, command.time, return_indices=True)
            stamps = joints.columns["stamp"][of_joints, 0].astype(float)
            which = "velocity" if self._sends_speeds else "position"
            of_limits = _shares_of_speeds if self._sends_speeds else _shares
            shares.append(of_limits(robot, stamps, command.columns[which][of_command]))
        links, at_rest = (np.nan, np.nan), None
        truth = self.folder / "truth.npz"
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
    velocity = np.diff(q, axis=0)[h != 0.0] / h[h != 0.0, None]
    h = h[h != 0.0]
    # Where messages are missing the speed between is a mean; an acceleration is that of neighbours only.
    # Where the clock was set nobody can say from the stamps what time has passed.
    near = _is_one_period(h[1:]) & _is_one_period(h[:-1])
    acceleration = np.diff(velocity, axis=0)[near] / (0.5 * (h[1:] + h[:-1]))[near, None]
    return (
        float((np.abs(velocity[h > 0.0]) / robot.speed).max()),
        float((np.abs(acceleration) / robot.acceleration).max()),
    )


def _shares_of_speeds(robot: RobotModel, time: np.ndarray, v: np.ndarray) -> tuple[float, float]:
    """As `_shares`, in speeds (n, 6) in rad/s that are all that is sent."""
    known = np.isfinite(v).all(axis=1)
    h, change = np.diff(time[known]), np.diff(v[known], axis=0)
    near = _is_one_period(h)
    return (
        float((np.abs(v[known]) / robot.speed).max()),
        float((np.abs(change[near] / h[near, None]) / robot.acceleration).max()),
    )


def _is_one_period(h: np.ndarray) -> np.ndarray:
    return (h > 0.5 * _PERIOD) & (h < 1.5 * _PERIOD)


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
            try:
                there = socket.create_connection(("127.0.0.1", target))
            except OSError:  # nobody is there, or not yet again
                here.close()
                continue
            for ends in ((here, there), (there, here)):
                threading.Thread(target=pump, args=ends, daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()
    sys.stdin.read()


if __name__ == "__main__":
    _relay_main(int(sys.argv[1]), int(sys.argv[2]))

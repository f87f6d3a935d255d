"""Sockets to a real station, or to a virtual cell that is started beside them."""

import json
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from diagrams.hardware_link import StationError
from diagrams.runs.virtual_cell import CellRecord
from diagrams.scenario.scenario import Scenario, scenario_text
from experiments.cli.workers import SimulationError
from robots.description.model import RobotModel
from systems.link.protocols import PoseSource, RobotLink
from systems.named_classes import OwnClassError
from systems.reference.cartesian_path import OutOfReachError

_PATIENCE = 30.0  # s in which a cell must have ended


@dataclass(frozen=True)
class StationClients:
    """Open connections."""

    client: RobotLink
    camera: PoseSource | None
    cell: "CellBeside | None"  # has its truth once the connections are closed


@contextmanager
def station_clients(
    scenario: Scenario,
    robot: RobotModel,
    with_cell: bool,
    needs_camera: bool,
    camera_delay: float | None = None,
) -> Iterator[StationClients]:
    """Connects to the station of a scenario, or to a virtual one that lives as long as the block.

    Args:
        scenario: whose link says where the station is.
        robot: as the controller knows it.
        with_cell: whether to start a virtual cell.
        needs_camera: whether to connect to the camera, if the station has one.
        camera_delay: s, from exposure to arrival; None for the scenario's.

    Raises:
        SimulationError: if the cell does not start, the station is not there, or a law or an inverse model of
            one's own gives what it must not.
        ValueError: if a part refuses its configuration.
    """
    link, period = scenario.station.link, scenario.station.period
    # The camera's delay is one named number, whoever delays it.
    delay = scenario.station.camera.delay if camera_delay is None else camera_delay
    try:
        with ExitStack() as stack:
            wire = link.wire(period, any_port=with_cell)
            client = stack.enter_context(link.open(robot, wire))
            cell = CellBeside(scenario, *client.ports) if with_cell else None
            camera_port = stack.enter_context(cell) if cell else None
            camera = None
            if needs_camera and link.has_camera:
                frames = link.camera_frame.pose(), link.tool_frame.pose()
                camera = stack.enter_context(link.camera.connect(*frames, delay, camera_port))
            yield StationClients(client, camera, cell)
    except (StationError, OwnClassError, OutOfReachError) as error:
        raise SimulationError(str(error)) from error


class CellBeside:
    """``truetip cell`` in a separate process, which shares nothing with this one but its ports."""

    def __init__(self, scenario: Scenario, port: int, signal_port: int = 0) -> None:
        """Prepares it; `__enter__` starts it.

        Args:
            scenario: whose station it is.
            port: where the client listens for the controller.
            signal_port: where it listens for test signals; 0 for none.
        """
        self.truth: CellRecord | None = None
        self.statistics: dict[str, Any] = {}
        self._folder = tempfile.TemporaryDirectory(prefix="truetip-cell-")
        folder = Path(self._folder.name)
        self._truth, self._json = folder / "truth.npz", folder / "cell.json"
        (folder / "scenario.yaml").write_text(scenario_text(scenario), encoding="utf-8")
        command = [sys.executable, "-m", "experiments.main", "cell", "--announce", "--until-eof"]
        command += ["--scenario", str(folder / "scenario.yaml"), "--set", f"station.link.port={port}"]
        command += ["--set", "station.link.camera.server.port=0"]
        command += ["--set", f"station.link.signal_port={signal_port}"]
        self._command = [*command, "--truth", str(self._truth), "--json", str(self._json)]

    def __enter__(self) -> int:
        """Starts the cell; returns the port of its camera. Raises SimulationError if it does not start."""
        # A session of its own: Ctrl-C in a terminal is for this process, which first stops the robot.
        self._process = subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            _, problem = self._process.communicate()
            self._folder.cleanup()
            raise SimulationError(f"the virtual cell did not start: {' '.join(problem.split())}")
        return int(json.loads(line)["camera_port"])

    def __exit__(self, *_: object) -> None:
        """Ends the cell and reads what it leaves behind."""
        self._process.send_signal(signal.SIGTERM)
        try:
            self._process.communicate(timeout=_PATIENCE)
            if self._truth.exists() and self._json.exists():
                self.truth = CellRecord.load(self._truth)
                self.statistics = json.loads(self._json.read_text(encoding="utf-8"))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
        finally:
            self._folder.cleanup()

"""Laws on a real station, and a virtual one started beside them."""

import json
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.guided_run import GuidedRecord, GuidedRun, StationError
from diagrams.log import RunLog
from diagrams.scenario import LinkConfig, Scenario, scenario_text
from diagrams.virtual_cell import CellRecord
from experiments.workers import SimulationError
from robots.model import RobotModel
from systems.egm.client import EgmClient
from systems.mocap.receiver import MocapReceiver
from systems.servo import BLIND_LAWS

_PATIENCE = 30.0  # s in which a cell must have ended


@dataclass
class GuidedComparison:
    """The records of several laws on one station."""

    records: dict[str, list[GuidedRecord]]
    cell: dict[str, Any] = field(default_factory=dict)  # how a cell of our own has run

    @property
    def logs(self) -> dict[str, list[RunLog]]:
        """The logs of every law."""
        return {law: [record.log for record in cycles] for law, cycles in self.records.items()}

    def link_json(self) -> dict[str, Any]:
        """What the wire did, for ``link.json``."""
        runs = {law: [_link_json(record) for record in cycles] for law, cycles in self.records.items()}
        return {"runs": runs, "cell": self.cell}


def compare_on_station(
    scenario: Scenario,
    robot: RobotModel,
    laws: Sequence[str],
    cycles: int = 1,
    with_cell: bool = False,
    progress: Callable[[float], None] | None = None,
) -> GuidedComparison:
    """Runs laws one after the other on the station that the scenario's link names.

    Args:
        scenario: what to do.
        robot: the robot as the controller knows it.
        laws: which laws, in this order.
        cycles: runs of each law.
        with_cell: whether to start a virtual cell for it; its truth is joined to the logs by time stamp.
        progress: is called now and then with the share that is done, 0 to 1.

    Raises:
        SimulationError: if the station is not there, or a run broke off before its path began.
        ValueError: if a part refuses its configuration.
    """
    jobs = [(law, GuidedRun(scenario, law, robot)) for law in laws for _ in range(cycles)]
    link, report = scenario.station.link, progress or (lambda share: None)
    records: dict[str, list[GuidedRecord]] = {law: [] for law in laws}
    truth: CellRecord | None = None
    cell: dict[str, Any] = {}
    with EgmClient(
        robot.speed,
        0 if with_cell else link.port,
        link.address,
        link.controller or None,
        link.break_after,
        period=scenario.station.period,
    ) as client:
        beside = CellBeside(scenario, client.channel.address[1]) if with_cell else None
        if beside:
            link = replace_camera_port(link, beside.__enter__())
        try:
            camera = _camera(link, scenario) if any(law not in BLIND_LAWS for law in laws) else None
            for number, (law, run) in enumerate(jobs):
                record = run.run(
                    client,
                    camera,
                    progress=lambda share, number=number: report((number + share) / len(jobs)),
                )
                records[law].append(record)
            if camera:
                camera.close()
        except StationError as error:
            raise SimulationError(str(error)) from error
        finally:
            if beside:
                beside.__exit__(None, None, None)
                truth, cell = beside.truth, beside.statistics
    if truth is not None:
        for cycles_of_law in records.values():
            for record in cycles_of_law:
                record.log = with_truth(record, truth)
    return GuidedComparison(records, cell)


def with_truth(record: GuidedRecord, truth: CellRecord) -> RunLog:
    """The log of a run with the truth of the cell beside it, matched by the controller's stamps."""
    stamps, ticks = record.stamps, np.arange(len(record.stamps))
    heard = np.isfinite(stamps)
    # A tick whose message was lost lies between its neighbours.
    X_WE, link_position = truth.at(np.interp(ticks, ticks[heard], stamps[heard]))
    known = np.isfinite(link_position)
    links = np.where(known, link_position, record.log.link_position)
    return replace(record.log, X_WE_true=X_WE, link_position=links)


class CellBeside:
    """``truetip cell`` in a process of its own, which this process learns nothing from but its ports."""

    def __init__(self, scenario: Scenario, port: int) -> None:
        """Prepares it; `__enter__` starts it.

        Args:
            scenario: whose station it is.
            port: where the client listens for the controller.
        """
        self.truth: CellRecord | None = None
        self.statistics: dict[str, Any] = {}
        self._folder = tempfile.TemporaryDirectory(prefix="truetip-cell-")
        folder = Path(self._folder.name)
        self._truth, self._json = folder / "truth.npz", folder / "cell.json"
        (folder / "scenario.yaml").write_text(scenario_text(scenario), encoding="utf-8")
        command = [sys.executable, "-m", "experiments.cli", "cell", "--announce"]
        command += ["--scenario", str(folder / "scenario.yaml"), "--set", f"station.link.port={port}"]
        command += ["--set", "station.link.camera.server.port=0"]
        self._command = [*command, "--truth", str(self._truth), "--json", str(self._json)]

    def __enter__(self) -> int:
        """Starts the cell; returns the port of its camera. Raises SimulationError if it does not start."""
        self._process = subprocess.Popen(
            self._command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
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


def replace_camera_port(link: LinkConfig, port: int) -> LinkConfig:
    """The same link with another port of the camera's computer."""
    return replace(link, camera=replace(link.camera, server=replace(link.camera.server, port=port)))


def _camera(link: LinkConfig, scenario: Scenario) -> MocapReceiver | None:
    if not link.has_camera:
        return None
    # The camera's delay is one named number, whoever delays it.
    clock = replace(link.camera.clock, smallest_delay=scenario.station.camera.delay)
    return MocapReceiver(replace(link.camera, clock=clock), link.camera_frame.pose(), link.tool_frame.pose())


def _link_json(record: GuidedRecord) -> dict[str, Any]:
    quantiles = np.percentile(record.turn_around, [50, 99, 100]) if len(record.turn_around) else [None] * 3
    clock = record.camera_clock
    drift, sigma = (clock.drift_ppm, 1e3 * clock.offset_sigma) if clock else (np.nan, np.nan)
    return {
        "ended": record.ended,
        "pauses_s": record.pauses,
        "controller": record.counters,
        "camera": record.camera,
        "turn_around_ms": {
            name: None if value is None else 1e3 * float(value)
            for name, value in zip(("median", "99%", "largest"), quantiles, strict=True)
        },
        "camera_drift_ppm": drift if np.isfinite(drift) else None,
        "camera_offset_sigma_ms": sigma if np.isfinite(sigma) else None,
    }

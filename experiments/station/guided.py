"""Laws on a real station, one after the other."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from diagrams.hardware_link import never
from diagrams.record.log import RunLog
from diagrams.record.run_record import RunRecord
from diagrams.runs.real_time import REQUESTED, RealTimeRecord, RealTimeRun
from diagrams.runs.virtual_cell import CellRecord
from diagrams.scenario.scenario import Scenario
from experiments.station.clients import station_clients
from robots.description.model import RobotModel


@dataclass
class GuidedComparison:
    """The records of several laws on one station."""

    records: dict[str, list[RealTimeRecord]]
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
    is_asked_to_end: Callable[[], bool] = never,
    recording: Callable[[str, int], RunRecord | None] = lambda law, number: None,
    is_acknowledged: Callable[[], bool] = never,
) -> GuidedComparison:
    """Runs laws one after the other on the station that the scenario's link names.

    Args:
        scenario: what to do.
        robot: the robot as the controller knows it.
        laws: which laws, in this order.
        cycles: runs of each law.
        with_cell: whether to start a virtual cell for it; its truth is joined to the logs by time stamp.
        progress: is called now and then with the share that is done, 0 to 1.
        is_asked_to_end: whether somebody wants an end; the run that goes on stops smoothly, none follows.
        recording: opens the record of a law's run with a number from 1.
        is_acknowledged: whether somebody now lets the robot go on that was stopped for people.

    Raises:
        SimulationError: if the station is not there, or a run broke off before its path began.
        ValueError: if a part refuses its configuration.
    """
    jobs = [(law, RealTimeRun(scenario, law, robot)) for law in laws for _ in range(cycles)]
    report = progress or (lambda share: None)
    records: dict[str, list[RealTimeRecord]] = {law: [] for law in laws}
    needs_camera = any(run.begins_with_camera for _, run in jobs)
    with station_clients(scenario, robot, with_cell, needs_camera) as station:
        for number, (law, run) in enumerate(jobs):
            record = run.run(
                station.client,
                station.camera,
                progress=lambda share, number=number: report((number + share) / len(jobs)),
                is_asked_to_end=is_asked_to_end,
                record=recording(law, len(records[law]) + 1),
                is_acknowledged=is_acknowledged,
            )
            records[law].append(record)
            if record.ended == REQUESTED:
                break
    cell = station.cell
    if cell and cell.truth is not None:
        for cycles_of_law in records.values():
            for record in cycles_of_law:
                record.log = with_truth(record, cell.truth)
    done = {law: cycles_of_law for law, cycles_of_law in records.items() if cycles_of_law}
    return GuidedComparison(done, cell.statistics if cell else {})


def with_truth(record: RealTimeRecord, truth: CellRecord) -> RunLog:
    """The log of a run with the truth of the cell beside it, matched by the controller's stamps."""
    stamps, ticks = record.stamps, np.arange(len(record.stamps))
    heard = np.isfinite(stamps)
    if not heard.any():
        return record.log
    # A tick whose message was lost lies between its neighbours.
    X_WE, link_position = truth.at(np.interp(ticks, ticks[heard], stamps[heard]))
    known = np.isfinite(link_position)
    links = np.where(known, link_position, record.log.link_position)
    return replace(record.log, X_WE_true=X_WE, link_position=links)


def _link_json(record: RealTimeRecord) -> dict[str, Any]:
    quantiles = np.percentile(record.turn_around, [50, 99, 100]) if len(record.turn_around) else [None] * 3
    clock = record.camera_clock
    drift, sigma = (clock.drift_ppm, 1e3 * clock.offset_sigma) if clock else (np.nan, np.nan)
    return {
        "ended": record.ended,
        "pauses_s": record.pauses,
        "events": [[event.time, event.kind, event.detail] for event in record.events],
        "limited_messages": record.limited_messages,
        "late_host": {
            "messages": record.host.messages,
            "late": record.host.late,
            "worst_ms": 1e3 * record.host.worst,
            "waited_s": record.host.waited,
            "stolen_s": record.host.stolen,
        },
        "controller": record.counters,
        "camera": record.camera,
        "turn_around_ms": {
            name: None if value is None else 1e3 * float(value)
            for name, value in zip(("median", "99%", "largest"), quantiles, strict=True)
        },
        "people": None
        if record.people is None
        else {
            "sets": record.people.sets,
            "ms_per_set": 1e3 * record.people.seconds / max(1, record.people.sets),
            "stops": record.people.stops,
            "oldest_images_s": record.people.largest_age,
        },
        "camera_drift_ppm": drift if np.isfinite(drift) else None,
        "camera_offset_sigma_ms": sigma if np.isfinite(sigma) else None,
    }

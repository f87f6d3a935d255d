"""Runs of the acceptance cycle on a station of hardware, by what its camera measures."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from diagrams.record.log import RunLog
from diagrams.runs.real_time import REQUESTED
from diagrams.scenario.scenario import Scenario
from experiments.cli.ending import asking
from experiments.cli.workers import SimulationError
from experiments.station.guided import compare_on_station
from robots.description.model import RobotModel


def guided_log(
    scenario: Scenario, robot: RobotModel, law: str, with_cell: bool, progress: Callable[[float], None]
) -> RunLog:
    """The log of a law on the station of a scenario; its true poses are those that the camera has measured.

    Raises:
        KeyboardInterrupt: if somebody ended it; the robot stands.
        SimulationError: if the station is not there, or the run did not come to its end.
        ValueError: if a part refuses its configuration.
    """
    with asking() as end:
        found = compare_on_station(
            scenario, robot, [law], 1, with_cell, progress, is_asked_to_end=end.is_asked
        )
    (record,) = found.records[law]
    if record.ended == REQUESTED:
        raise KeyboardInterrupt
    if record.ended != "path":
        raise SimulationError(f"accept robot: the run did not come to its end: {record.ended}")
    return by_camera(record.log)


def by_camera(log: RunLog) -> RunLog:
    """A log with the poses of the camera as the true ones; what it missed lies between its neighbours.

    Raises:
        SimulationError: if it has seen less than half of the poses.
    """
    seen = np.isfinite(log.X_WE_measured).all(axis=(1, 2))
    if seen.mean() < 0.5:
        raise SimulationError(
            f"accept robot: the camera saw the tool in {100.0 * seen.mean():.0f} % of the time"
        )
    times = np.clip(log.time, *log.time[seen][[0, -1]])
    X_WE = np.tile(np.eye(4), (len(times), 1, 1))
    X_WE[:, :3, :3] = Slerp(log.time[seen], Rotation.from_matrix(log.X_WE_measured[seen, :3, :3]))(
        times
    ).as_matrix()
    X_WE[:, :3, 3] = np.stack(
        [np.interp(times, log.time[seen], log.X_WE_measured[seen, axis, 3]) for axis in range(3)], -1
    )
    return replace(log, X_WE_true=X_WE)

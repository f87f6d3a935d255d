"""A check on a station: its controller is guided to the poses, rests there, and its camera measures."""

from collections.abc import Callable

import numpy as np

from diagrams.hardware_link import EndedOnRequest
from diagrams.runs.guided_measurement import GuidedMeasurement, Row, Visit
from experiments.cli.ending import asking
from experiments.cli.prepare import Prepared
from experiments.station.clients import station_clients
from robots.description.model import NUM_JOINTS
from robots.measurement_design.clear_ways import ClearWays
from robots.measurement_design.constraints import AdmissibleConfig, AdmissibleConfigurations


def check_on_station(
    prepared: Prepared, q: np.ndarray, with_cell: bool, progress: Callable[[float], None]
) -> np.ndarray:
    """Measures poses on ways that are clear of floor and arm.

    Args:
        prepared: whose station this is.
        q: the configurations in rad, (n, 6).
        with_cell: whether to start a virtual cell.
        progress: is called with the share that is done.

    Returns:
        The tool's poses, (n, 4, 4).

    Raises:
        KeyboardInterrupt: if somebody ended it; the robot stands.
        SimulationError: if the station is not there, or fell silent.
        ValueError: if there is no clear way, or the camera saw too little at a pose.
    """
    robot, config = prepared.robot, AdmissibleConfig()
    ways = ClearWays(robot, AdmissibleConfigurations(robot, config), config.clearance)
    vias = [np.zeros((0, NUM_JOINTS)), *ways.through(q)]
    visits = [Visit(number, *each) for number, each in enumerate(zip(q, vias, strict=True), 1)]
    X_WE = np.tile(np.eye(4), (len(q), 1, 1))

    def keep(visit: Visit, row: Row) -> None:
        _, X_WE[visit.number - 1, :3, 3], X_WE[visit.number - 1, :3, :3] = row

    run = GuidedMeasurement(prepared.scenario, robot)
    with asking() as end, station_clients(prepared.scenario, robot, with_cell, True) as station:
        assert station.camera is not None
        try:
            unseen = run.run(
                station.client,
                station.camera,
                visits,
                keep,
                progress,
                is_asked_to_end=end.is_asked,
                first_way=ways.between,
            )
        except EndedOnRequest:
            raise KeyboardInterrupt from None
    if unseen:
        raise ValueError(f"health: the camera saw too little at poses {', '.join(map(str, unseen))}")
    return X_WE

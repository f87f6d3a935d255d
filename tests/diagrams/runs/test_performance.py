"""A controller that reports more than all of its performance: the path is slowed and never left."""

import numpy as np
import pytest

from diagrams.runs.real_time import RealTimeRecord, RealTimeRun
from diagrams.scenario.scenario import load_scenario
from robots.description.model import load_robot
from tests.diagrams.lockstep import Lockstep

# The path needs up to 1.6 of what this controller gives.
WEAK = [
    "reference.path=circle",
    "reference.acceleration=4",
    "reference.settle=0.5",
    "reference.dwell=0.3",
    "station.elasticity=rigid",
    "station.kind=egm",
]


def run(performance: float, obeys: bool) -> tuple[RealTimeRecord, float]:
    """A run, and the largest utilisation rate that its commands need."""
    settings = [
        f"station.link.run.performance={performance}",
        f"servo.guard.obey_utilization={str(obeys).lower()}",
    ]
    scenario = load_scenario("cell", [*WEAK, *settings])
    wire = Lockstep(scenario)
    record = RealTimeRun(scenario, "open_loop").run(wire.link, wire.camera(), now=wire.now)
    assert record.ended == "path"
    speed = np.abs(np.diff(record.log.position_command, axis=0)) / scenario.station.period
    return record, float((speed / load_robot("irb1200").speed).max() / performance)


@pytest.mark.slow
def test_the_path_is_slowed_until_the_controller_can_follow_it_and_is_the_same_path():
    full, largest = run(2.0, obeys=True)
    weak = 0.6 * 2.0 * largest
    told, needed = run(weak, obeys=False)
    obeyed, _ = run(weak, obeys=True)
    assert needed > 1.5
    assert told.counters["overloaded"] > 50
    assert obeyed.counters["overloaded"] < 0.7 * told.counters["overloaded"]
    assert len(obeyed.log.time) > 1.2 * len(told.log.time)
    assert len(full.log.time) == len(told.log.time)
    # Wherever it is, it is on the circle: as near to a point of the other run as these are to each other.
    gaps = np.linalg.norm(
        obeyed.log.X_WE_desired[::25, None, :3, 3] - told.log.X_WE_desired[None, :, :3, 3], axis=2
    ).min(axis=1)
    steps = np.linalg.norm(np.diff(told.log.X_WE_desired[:, :3, 3], axis=0), axis=1)
    assert gaps.max() <= steps.max()

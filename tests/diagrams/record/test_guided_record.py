"""A run on a station is logged while it goes on: the file says what the log says."""

import numpy as np
import pytest

from diagrams.record.read_record import read_record
from diagrams.record.run_record import RunRecord
from diagrams.record.topics import COMMAND, DESIRED, EVENT, JOINTS, POSE
from diagrams.runs.real_time import RealTimeRun
from diagrams.scenario.scenario import load_scenario, scenario_text
from tests.diagrams.lockstep import Lockstep

FAST = ["reference.acceleration=6", "reference.settle=0.5", "reference.path=circle", "reference.dwell=0.3"]


@pytest.mark.slow
def test_the_record_is_the_log(tmp_path):
    scenario = load_scenario("cell", [*FAST, "station.faults.stall_at=2.4", "station.faults.stall_for=0.06"])
    wire, path = Lockstep(scenario), tmp_path / "run.mcap"
    record = RunRecord(path, scenario_text(scenario))
    log = RealTimeRun(scenario, "numerical_ik").run(wire.link, wire.camera(), now=wire.now, record=record)
    found = read_record(path)
    assert found.is_complete
    again = load_scenario(_written(tmp_path, found.scenario))
    assert scenario_text(again) == scenario_text(scenario)
    heard = np.isfinite(log.stamps)
    ticks = np.flatnonzero(heard)
    np.testing.assert_allclose(found.topics[COMMAND].time, log.log.time[ticks], atol=1e-6)
    np.testing.assert_allclose(found.topics[JOINTS].columns["stamp"][:, 0], log.stamps[ticks], rtol=1e-12)
    np.testing.assert_array_equal(found.topics[JOINTS].columns["position"], log.log.joint_position[ticks])
    # The log has what stands before a tick, the record what was answered.
    wanted = np.array([found.topics[DESIRED].columns[f"pose.position.{axis}"][:, 0] for axis in "xyz"]).T
    np.testing.assert_allclose(wanted[1:], log.log.X_WE_desired[ticks[1:], :3, 3], atol=1e-3)
    assert len(found.topics[POSE].time) > 0.9 * len(ticks)
    kinds = set(found.topics[EVENT].columns["kind"][:, 0])
    assert kinds == {event.kind for event in log.log.guard_events}
    assert "interrupted" in kinds
    assert found.run["ended"] == log.ended == "path"


def _written(folder, text: str) -> str:
    path = folder / "scenario.yaml"
    path.write_text(text)
    return str(path)

"""A record gives back the log that was written: the same errors, to the last digit that a summary shows."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagrams.record.log import GuardEvent, RunLog
from diagrams.record.read_record import read_record
from diagrams.record.restored import restored
from diagrams.record.run_record import RunRecord, marks, write_log, write_tick
from diagrams.record.topics import POSE, pose_message
from experiments.metrics.run_metrics import pose_errors, summary
from tests.experiments.synthetic import comparison, displaced, rectangle


@pytest.fixture(scope="module")
def log() -> RunLog:
    found = comparison(with_joints=True)["pbvs"][0]
    return replace(found, guard_events=[GuardEvent(2.0, "interrupted", "no message for 50 ms")])


def test_a_simulated_run_has_the_same_summary_again(log: RunLog, tmp_path: Path):
    write_log(tmp_path / "run.mcap", "seed: 0\n", log)
    again = restored(read_record(tmp_path / "run.mcap"), "run.mcap")
    first, second = (summary("it", {"pbvs": [each]}) for each in (log, again))
    for source in ("true", "measured"):
        for key, value in first["runs"]["pbvs"][source].items():
            if isinstance(value, float | list):
                # Quaternions and nanoseconds round at 1e-16 and 1e-9.
                np.testing.assert_allclose(second["runs"]["pbvs"][source][key], value, rtol=1e-6, atol=1e-9)
    assert again.guard_events == log.guard_events
    assert (again.path_start, again.path_end, again.seed) == (log.path_start, log.path_end, log.seed)
    np.testing.assert_array_equal(again.position_command, log.position_command)
    np.testing.assert_array_equal(again.correction, log.correction)


def test_where_the_path_was_slowed_it_is_known_where_it_was(log: RunLog, tmp_path: Path):
    slowed = log.time - 0.3 * np.clip(log.time - 1.0, 0.0, 0.5)
    write_log(tmp_path / "run.mcap", "", replace(log, path_time=slowed))
    again = restored(read_record(tmp_path / "run.mcap"), "run.mcap")
    assert again.path_time is not None
    np.testing.assert_allclose(again.path_time, slowed, atol=2e-9)  # times are in nanoseconds
    write_log(tmp_path / "run.mcap", "", log)
    assert restored(read_record(tmp_path / "run.mcap"), "run.mcap").path_time is None


def test_on_hardware_the_wanted_pose_is_that_of_the_exposure(log: RunLog, tmp_path: Path):
    """Exposures fall between ticks: the pose of the nearest tick would be off by half a period."""
    ticks = np.arange(0.0, 4.0, 0.004)
    exposed = np.arange(0.011, 3.9, 0.01)
    error = np.array([0.0, 0.0, 1e-3, 1e-4, 0.0, 0.0])
    seen = displaced(rectangle(exposed), error)
    record = RunRecord(tmp_path / "run.mcap", "")
    wanted, nothing = rectangle(ticks), np.zeros(6)
    for n, at in enumerate(ticks.tolist()):
        write_tick(record, at, at, (nothing, nothing), (nothing, nothing), nothing, wanted[n])
    for X, at in zip(seen, exposed.tolist(), strict=True):
        message = pose_message(X, at)
        record.write(POSE, at + 0.02, message)  # it arrives later
    record.close(**marks(replace(log, path_start=0.0, dwell_start=3.0, path_end=3.8), "path"))
    again = restored(read_record(tmp_path / "run.mcap"), "run.mcap")
    np.testing.assert_allclose(again.time, exposed, atol=1e-9)
    found = pose_errors(again, "measured")
    # Linear between ticks: the acceleration of 0.2 m/s^2 bends the path by less than a micrometre in 4 ms.
    np.testing.assert_allclose(found, np.tile(error, (len(found), 1)), atol=2e-6)
    assert np.isnan(again.X_WE_true).all()


def test_a_record_that_was_cut_off_is_refused(log: RunLog, tmp_path: Path):
    record, nothing = RunRecord(tmp_path / "cut.mcap", ""), np.zeros(6)
    write_tick(record, 0.0, 0.0, (nothing, nothing), (nothing, nothing), nothing, log.X_WE_desired[0])
    record.flush()
    with pytest.raises(
        ValueError, match=r"cut.mcap: the record ends early at byte \d+, after 4 messages: it does not say"
    ):
        restored(read_record(tmp_path / "cut.mcap"), "cut.mcap")

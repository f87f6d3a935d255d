"""The record on disk: what was logged is what is read, also after the writer was killed."""

import os
import signal
import subprocess
import sys
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from diagrams.record.log import GuardEvent, RunLog
from diagrams.record.read_record import read_record
from diagrams.record.run_record import RunRecord, write_log, write_tick
from diagrams.record.topics import COMMAND, DESIRED, EVENT, JOINTS, POSE, SCHEMAS, TRUE_POSE
from tests.experiments.synthetic import comparison

pytestmark = pytest.mark.real_time


@pytest.fixture(scope="module")
def log() -> RunLog:
    found = next(iter(comparison(with_joints=True).values()))[0]
    return replace(found, guard_events=[GuardEvent(2.0, "interrupted", "no message for 50 ms")])


def test_what_is_read_is_what_was_logged(log: RunLog, tmp_path):
    path = tmp_path / "run.mcap"
    write_log(path, "law: pbvs\n", log)
    found = read_record(path)
    assert found.is_complete
    assert found.scenario == "law: pbvs\n"
    assert (found.run["law"], found.run["path_end"], found.run["ended"]) == (log.law, log.path_end, "path")
    np.testing.assert_allclose(found.topics[COMMAND].time, log.time, atol=1e-9)
    np.testing.assert_array_equal(found.topics[COMMAND].columns["position"], log.position_command)
    np.testing.assert_array_equal(found.topics[JOINTS].columns["effort"], log.joint_effort)
    p_WE = [found.topics[TRUE_POSE].columns[f"pose.position.{axis}"][:, 0] for axis in "xyz"]
    known = np.isfinite(log.X_WE_true).all(axis=(1, 2))
    np.testing.assert_array_equal(np.array(p_WE).T, log.X_WE_true[known, :3, 3])
    assert len(found.topics[EVENT].time) == len(log.guard_events)
    assert found.topics[EVENT].columns["kind"][0, 0] == log.guard_events[0].kind


def test_a_run_that_never_begins_leaves_the_record_of_an_earlier_one(log: RunLog, tmp_path):
    path = tmp_path / "run.mcap"
    write_log(path, "", log)
    earlier = path.read_bytes()
    RunRecord(path, "").close(ended="nobody answers")
    assert path.read_bytes() == earlier
    assert [file.name for file in tmp_path.iterdir()] == ["run.mcap"]


def test_other_readers_find_topics_and_schemas(log: RunLog, tmp_path):
    path = tmp_path / "run.mcap"
    write_log(path, "", log)
    with path.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary is not None
    assert {channel.topic for channel in summary.channels.values()} <= set(SCHEMAS)
    by_topic = {
        channel.topic: summary.schemas[channel.schema_id].name for channel in summary.channels.values()
    }
    assert by_topic[POSE] == by_topic[DESIRED] == "foxglove.PoseInFrame"
    assert summary.statistics is not None
    assert summary.statistics.channel_message_counts


WRITER = """
import sys, time
import numpy as np
from diagrams.record.run_record import RunRecord, write_tick
record, six = RunRecord(sys.argv[1], "text"), np.zeros(6)
for tick in range(10**6):
    write_tick(record, 4e-3 * tick, 1.0, (six + tick, six), (six, six), six, np.eye(4))
    if tick == 500:
        record.flush()
        print("flushed", flush=True)
    if tick > 500:
        time.sleep(1e-3)
"""


def test_after_a_kill_everything_that_was_flushed_is_there(tmp_path):
    path = tmp_path / "run.mcap"
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline().strip() == "flushed"
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    found = read_record(path)
    assert not found.is_complete
    assert found.scenario == "text"
    positions = found.topics[JOINTS].columns["position"][:, 0]
    assert len(positions) >= 501
    np.testing.assert_array_equal(positions, np.arange(len(positions)))


WAITER = """
import os, signal, sys
from diagrams.record.run_record import RunRecord
record = RunRecord(sys.argv[1], "text")
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize("has_earlier", [False, True])
def test_who_is_killed_before_the_first_message_leaves_nothing_hidden(
    log: RunLog, tmp_path: Path, has_earlier: bool
):
    """As while a robot is on its way to the start; an earlier record is worth more than an empty one."""
    path = tmp_path / "run.mcap"
    if has_earlier:
        write_log(path, "an earlier one", log)
    earlier = path.read_bytes() if has_earlier else b""
    subprocess.run([sys.executable, "-c", WAITER, str(path)], check=False)
    assert [file.name for file in tmp_path.iterdir()] == ["run.mcap"]
    assert not has_earlier or path.read_bytes() == earlier
    assert read_record(path).scenario == ("an earlier one" if has_earlier else "text")


def test_a_shorter_record_in_the_place_of_a_longer_one_is_whole(log: RunLog, tmp_path: Path):
    path, six = tmp_path / "run.mcap", np.zeros(6)
    write_log(path, "an earlier one", log)
    record = RunRecord(path, "text")
    write_tick(record, 0.0, 1.0, (six, six), (six, six), six, np.eye(4))
    record.close()
    found = read_record(path)
    assert (found.is_complete, found.scenario, len(found.topics[JOINTS].time)) == (True, "text", 1)


@pytest.mark.parametrize("share", [0.3, 0.7, 0.99])
def test_a_file_that_was_cut_anywhere_is_read_as_far_as_it_goes(share: float, log: RunLog, tmp_path):
    path = tmp_path / "run.mcap"
    record, six = RunRecord(path, ""), np.zeros(6)
    for tick in range(400):
        write_tick(record, 4e-3 * tick, None, (six, six), (six, six), six, np.eye(4))
        if tick % 50 == 49:
            record.flush()
    record.close()
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    found = read_record(path)
    assert not found.is_complete
    assert len(found.topics[JOINTS].time) >= 50 * int(8 * (share - 0.2))


@pytest.mark.slow
def test_writing_needs_no_more_memory_the_longer_it_takes(tmp_path):
    record, six = RunRecord(tmp_path / "run.mcap", ""), np.zeros(6)

    def write(ticks: range) -> int:
        for tick in ticks:
            write_tick(record, 4e-3 * tick, None, (six, six), (six, six), six, np.eye(4))
            if tick % 250 == 0:
                record.flush()
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        first = write(range(1000))
        # An hour has 890,000 ticks; what is kept of each chunk is its index.
        assert (write(range(1000, 3000)) - first) / 2000 * 890_000 < 20e6
    finally:
        tracemalloc.stop()
    record.close()


def test_a_full_disk_ends_the_record_and_not_the_run():
    """The device refuses every byte that reaches it."""
    record, six = RunRecord("/dev/full", ""), np.zeros(6)
    for tick in range(5000):
        write_tick(record, 4e-3 * tick, None, (six, six), (six, six), six, np.eye(4))
    record.close()
    assert record.problem == "/dev/full: no space left on device after 0 bytes; what is written can be read"


def test_what_is_no_record_is_refused(tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(b"something else entirely, of some length")
    with pytest.raises(ValueError, match="not an MCAP file"):
        read_record(path)

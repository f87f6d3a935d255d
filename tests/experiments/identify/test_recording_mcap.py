"""Recorded motions as MCAP files: several in one, and the record of a run without sensors."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.record.run_record import RunRecord
from diagrams.record.topics import JOINTS
from experiments.identify.recording_file import read_recording, write_recording
from experiments.identify.recording_map import Recording
from experiments.identify.slow import identify_slow_recording
from robots.description.model import load_robot
from robots.identification.recording import RecordedCase
from tests.experiments.commands import refusal
from tests.experiments.identify.test_identify_command import GYRO, run
from tests.robots.identification.test_slow_motion import PRELOAD, TRUE_LOAD, slow_motion


def test_motions_in_one_mcap_file_keep_their_own_times_and_clocks(tmp_path: Path):
    """Also where the sensors' clock is ahead, and where they were read more slowly than the motors."""
    time, stamps = 4e-3 * np.arange(200), 0.2 + 5e-3 * np.arange(150)
    rng, path = np.random.default_rng(3), tmp_path / "two.mcap"
    cases = []
    for name in ("up", "down"):
        theta = np.outer(np.sin(3.0 * time), rng.normal(size=6))
        rate = np.outer(3.0 * np.cos(3.0 * time), theta[1] / np.sin(3.0 * time[1]))
        told = rng.normal(size=(200, 3, 6)).repeat(2, axis=0)[:200]
        shown = rng.normal(size=(150, 1, 3))
        cases.append(RecordedCase(name, time, theta, rate, 10.0 * rate, stamps, shown, told))
    write_recording(path, Recording(None, cases, [GYRO], 8e-3))
    for found, written in zip(read_recording(path).cases, cases, strict=True):
        assert found.name == written.name
        np.testing.assert_allclose(found.time, written.time)
        np.testing.assert_allclose(found.stamps, written.stamps)
        np.testing.assert_allclose(found.torque, written.torque)
        np.testing.assert_allclose(found.readings, written.readings)
        assert found.commands is not None
        assert written.commands is not None
        np.testing.assert_allclose(found.commands, written.commands)
        # Velocities are not in the file; a spline through the positions has them but for its ends.
        np.testing.assert_allclose(found.rate[5:-5], written.rate[5:-5], atol=1e-5)


def run_record(path: Path, time: np.ndarray, theta: np.ndarray, torque: np.ndarray) -> Path:
    """What a run leaves of its joints."""
    record = RunRecord(path, "")
    for at, q, effort in zip(time.tolist(), theta.tolist(), torque.tolist(), strict=True):
        record.write(JOINTS, at, {"stamp": None, "position": q, "effort": effort})
    record.close()
    return path


def test_the_record_of_a_run_without_sensors_is_named_as_such(tmp_path: Path):
    time = 4e-3 * np.arange(100)
    path = run_record(tmp_path / "run.mcap", time, np.zeros((100, 6)), np.zeros((100, 6)))
    message = refusal(run(tmp_path, f"--recording={path}"))
    assert (
        "a run without gyros and accelerometers shows load and friction (--slow), but no springs" in message
    )
    assert "needs no column map" in refusal(run(tmp_path, f"--recording={path}", "--columns=mine.yaml"))


@pytest.mark.slow
def test_the_record_of_a_slow_run_gives_load_and_spring(tmp_path: Path):
    robot = load_robot("kr210")
    motion = slow_motion(robot)
    rows = slice(0, 700)
    time = motion.period * np.arange(700)
    path = run_record(tmp_path / "run.mcap", time, motion.theta[rows], motion.torque[rows])
    found = identify_slow_recording(path, robot)
    assert found.payload == pytest.approx(TRUE_LOAD, rel=0.01)
    assert found.spring_preload == pytest.approx(PRELOAD, rel=0.02)

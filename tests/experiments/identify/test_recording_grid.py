"""Samples that were lost on the way are filled in where they are few, and said; more are refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.identify.recording_file import read_recording, write_recording
from experiments.identify.recording_grid import even_grid, filled_note
from experiments.identify.recording_map import Recording
from experiments.identify.slow import identify_slow_recording
from robots.description.model import load_robot
from robots.identification.recording import RecordedCase, RecordingError
from tests.experiments.identify.test_recording_mcap import run_record
from tests.robots.identification.test_slow_motion import TRUE_LOAD, slow_motion

PERIOD = 4e-3  # s
N = 500
TIME = PERIOD * np.arange(N)
THETA = np.outer(np.sin(3.0 * TIME), np.arange(1.0, 7.0))


def place(row: int) -> str:
    return f"sample {row + 1}"


@given(st.sets(st.integers(1, N - 2), max_size=5), st.floats(0.0, 100.0))
def test_what_is_filled_in_lies_on_the_grid_and_the_samples_stay(lost: set[int], begin: float):
    kept = np.setdiff1d(np.arange(N), list(lost))
    try:
        grid = even_grid(place, begin + TIME[kept])
    except RecordingError:
        assert max(np.diff(kept)) > 4
        return
    np.testing.assert_array_equal(grid.rows, kept)
    np.testing.assert_allclose(grid.linear(begin + TIME[kept]), begin + TIME, rtol=0.0, atol=1e-9)
    found = grid.smooth(THETA[kept])
    np.testing.assert_array_equal(found[kept], THETA[kept])
    np.testing.assert_allclose(found, THETA, rtol=0.0, atol=1e-6)
    np.testing.assert_array_equal(grid.following(np.arange(N)[kept])[kept], kept)
    assert grid.missing == len(lost)


def test_times_within_their_jitter_are_left_as_they_are():
    time = TIME + 5e-3 * PERIOD * np.random.default_rng(0).uniform(-1.0, 1.0, N)
    grid = even_grid(place, time)
    assert grid.missing == 0
    assert grid.linear(time) is time


@pytest.mark.parametrize(
    ("lost", "said"),
    [
        (
            range(10, 14),
            "sample 11: .* evenly spaced, got 0.02 s after 0.004 s: 4 in a row are missing, up to 3",
        ),
        (range(10, 130, 20), "sample 11: .* got 0.008 s after 0.004 s: 6 of 500 are missing, up to 1 %"),
    ],
)
def test_more_is_refused_with_the_reason(lost: range, said: str):
    with pytest.raises(RecordingError, match=said):
        even_grid(place, np.delete(TIME, list(lost)))


def test_times_off_the_grid_are_refused():
    time = TIME.copy()
    time[200:] += 0.4 * PERIOD
    said = r"sample 201: .* got 0.0056 s after 0.004 s$"
    with pytest.raises(RecordingError, match=said):
        even_grid(place, time)


def test_a_clock_that_is_off_by_little_is_not_taken_for_gaps():
    assert even_grid(place, (1.0 + 2e-4) * TIME).missing == 0


def test_it_is_said_how_many_samples_were_filled_in_and_the_longest_gap():
    whole, one, three = (even_grid(place, np.delete(TIME, lost)) for lost in ([], [40], [40, 41, 90]))
    assert filled_note(Path("run.mcap"), [whole]) == ""
    assert filled_note(Path("run.mcap"), [one, whole]) == (
        "run.mcap: 1 of 1000 samples of the robot is missing and filled in by interpolation, the longest gap "
        "is 0.008 s"
    )
    said = filled_note(Path("run.mcap"), [three])
    assert "3 of 500 samples of the robot are missing and filled in" in said
    assert said.endswith("the longest gap is 0.012 s")


def test_a_record_with_a_lost_message_is_read_and_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    kept = np.delete(np.arange(N), [77, 300, 301])
    path = run_record(tmp_path / "run.mcap", TIME[kept], THETA[kept], 10.0 * THETA[kept])
    (case,) = read_recording(path, needs_sensors=False).cases
    np.testing.assert_allclose(case.time, TIME, atol=1e-8)
    np.testing.assert_allclose(case.theta, THETA, atol=1e-6)
    np.testing.assert_allclose(case.torque, 10.0 * THETA, atol=5e-3)  # of a straight line
    assert case.rate.shape == THETA.shape
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"truetip: recording {path}: 3 of 500 samples of the robot are missing")


@pytest.mark.parametrize("has_torque", [True, False])
def test_a_table_without_a_few_rows_keeps_readings_as_they_are(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], has_torque: bool
):
    commands = np.repeat(np.random.default_rng(1).normal(size=(N // 2, 3, 6)), 2, axis=0)
    torque = 10.0 * THETA if has_torque else THETA[:0]
    rate = 3.0 * np.cos(3.0 * TIME)[:, None] * np.arange(1.0, 7.0)
    case = RecordedCase("up", TIME, THETA, rate, torque, TIME, np.zeros((N, 0, 3)), commands)
    path = tmp_path / "table.csv"
    write_recording(path, Recording(None, [case, replace(case, name="down")], [], 2.0 * PERIOD))
    head, *lines = path.read_text().splitlines()
    path.write_text("\n".join([head, *lines[:100], *lines[101:]]))
    found = read_recording(path, needs_sensors=False).cases
    for each in found:
        np.testing.assert_allclose(each.theta, THETA, atol=1e-6)
        np.testing.assert_allclose(each.rate, rate, atol=1e-5)
        assert each.torque.shape == torque.shape
        assert each.commands is not None
        np.testing.assert_allclose(each.commands, commands, atol=1e-8)
    assert [len(each.stamps) for each in found] == [len(each.readings) for each in found] == [N - 1, N]
    assert "1 of 1000 samples of the robot is missing" in capsys.readouterr().err


@pytest.mark.slow
def test_lost_messages_do_not_change_what_a_slow_run_says(tmp_path: Path):
    robot = load_robot("kr210")
    motion = slow_motion(robot)
    kept = np.delete(np.arange(700), [100, 101, 350, 500, 620])
    time = motion.period * kept
    path = run_record(tmp_path / "run.mcap", time, motion.theta[kept], motion.torque[kept])
    assert identify_slow_recording(path, robot).payload == pytest.approx(TRUE_LOAD, rel=0.01)

"""A stop for people over UDP: the robot stands until somebody lets it go on; the log tells it in order."""

import json
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from diagrams.record.read_record import read_record
from diagrams.record.topics import EVENT
from diagrams.scenario.scenario import load_scenario
from tests.experiments.station.test_endings import PATIENCE, started

pytestmark = [pytest.mark.slow, pytest.mark.real_time]

# For a busy machine: a third of the messages, and a controller that does not give up a servo that is late.
PERIOD = 0.012
SETTINGS = [
    "servo.separation.acknowledge=true",
    "station.link.run.timeout=5",
    "station.link.break_after=5",
    f"station.period={PERIOD}",
    f"station.drive.command_delay={PERIOD}",
    f"reference.preview={PERIOD}",
]
OF_STOPS = ("stopped_for_people", "acknowledged", "goes_on")


def said(record: Path) -> list[str]:
    """Kinds of the events in a record that is still being written."""
    try:
        topics = read_record(record).topics
    except (OSError, ValueError):
        return []  # it has not begun
    return topics[EVENT].columns["kind"].ravel().tolist() if EVENT in topics else []


def test_a_button_lets_a_robot_go_on_once_nobody_is_near(tmp_path: Path):
    arguments = ["run", "--scenario", "cell-watched", "--with-cell", "--law", "open_loop", "--out", "results"]
    process, _ = started(tmp_path, *arguments, *(each for value in SETTINGS for each in ("--set", value)))
    record, presses, patience = tmp_path / "results" / "open_loop-1.mcap", 0, time.monotonic() + PATIENCE
    while process.poll() is None and "goes_on" not in said(record):
        # The first time at once, while somebody is near; then again whenever the last has come to nothing.
        if "stopped_for_people" in said(record) and said(record).count("acknowledged") == presses:
            process.send_signal(signal.SIGUSR1)
            presses += 1
        assert time.monotonic() < patience, f"the robot does not go on after {presses} times"
        time.sleep(0.5)
    _, problem = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, problem
    link = json.loads((tmp_path / "results" / "link.json").read_text())["runs"]["open_loop"][0]
    assert link["ended"] == "path"
    told = [(at, kind) for at, kind, _ in link["events"] if kind in OF_STOPS]
    kinds = [kind for _, kind in told]
    assert kinds[:3] == ["stopped_for_people", "acknowledged", "acknowledged"]
    assert set(kinds[1 : kinds.index("goes_on")]) == {"acknowledged"}
    # From when the path has come to rest until the button the robot is commanded to stand.
    stopped, goes_on = told[0][0], told[kinds.index("goes_on")][0]
    slowing = load_scenario("cell-watched", SETTINGS).reference.slowing
    with np.load(tmp_path / "results" / "open_loop-1.npz") as log:
        stands = (log["time"] > stopped + slowing + 0.1) & (log["time"] < goes_on)
        assert stands.any()
        assert np.abs(log["velocity_command"][stands]).max() < 1e-6
        assert np.abs(log["velocity_command"][log["time"] > goes_on]).max() > 0.05

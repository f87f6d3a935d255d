"""Whoever ends a run on a station gets a smooth stop, its record, a report, and no process or folder left."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.real_time

COMMAND = [sys.executable, "-m", "experiments.main"]
PATIENCE = 120.0  # s, for a busy machine


def until(condition, what: str) -> None:
    """Waits for something that another process does."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, f"no {what} within {PATIENCE:g} s"
        time.sleep(0.05)


def children(pid: int) -> list[int]:
    """The processes that a process has started."""
    listed = subprocess.run(["ps", "--ppid", str(pid), "-o", "pid="], capture_output=True, text=True)
    return [int(each) for each in listed.stdout.split()]


def is_alive(pid: int) -> bool:
    """Whether a process runs; one that only waits to be collected does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def started(tmp_path: Path, *arguments: str) -> tuple[subprocess.Popen, list[int]]:
    """A command and the processes it has started, once there are some."""
    environment = os.environ | {"TMPDIR": str(tmp_path / "temporary")}
    (tmp_path / "temporary").mkdir()
    process = subprocess.Popen(
        [*COMMAND, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        cwd=tmp_path,
        start_new_session=True,
        # What a shell starts in the background ignores it, and hands that down.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    until(lambda: children(process.pid), "child")
    return process, children(process.pid)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_run_that_is_ended_leaves_its_record_and_nothing_else(tmp_path: Path, number: int, code: int):
    arguments = (
        "run",
        "--with-cell",
        "--law",
        "open_loop",
        "--out",
        "results",
        "--set",
        "reference.settle=1",
    )
    process, below = started(tmp_path, *arguments, "--set", "reference.settle=1")
    time.sleep(15.0)
    process.send_signal(number)
    _, problem = process.communicate(timeout=PATIENCE)
    assert process.returncode == code, problem
    assert "ended on request" in problem
    assert not any(is_alive(each) for each in below)
    results = {path.name for path in (tmp_path / "results").iterdir()}
    assert {"link.json", "open_loop-1.npz"} <= results
    assert {path.name for path in tmp_path.iterdir()} == {"results", "temporary"}
    assert not list((tmp_path / "temporary").iterdir())
    link = json.loads((tmp_path / "results" / "link.json").read_text())
    assert link["runs"]["open_loop"][0]["ended"] == "ended on request"
    with np.load(tmp_path / "results" / "open_loop-1.npz") as log:
        if len(log["time"]) and log["time"][-1] > 1.0:
            assert "report.html" in results


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "--with-cell", "--law", "open_loop"),
        ("compare", "--scenario", "nominal", "--jobs", "2", "--laws", "open_loop,pbvs"),
    ],
)
def test_a_killed_command_leaves_no_process_behind(tmp_path: Path, arguments: tuple[str, ...]):
    process, below = started(tmp_path, *arguments)
    time.sleep(5.0)
    below = below + children(process.pid)
    process.kill()
    process.communicate(timeout=PATIENCE)
    until(lambda: not any(is_alive(each) for each in below), "end of all processes")


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_simulation_that_is_ended_leaves_nothing(tmp_path: Path, number: int, code: int):
    arguments = ("compare", "--scenario", "nominal", "--jobs", "1", "--laws", "open_loop", "--out", "results")
    process, below = started(tmp_path, *arguments)
    time.sleep(2.0)
    process.send_signal(number)
    _, problem = process.communicate(timeout=PATIENCE)
    assert (process.returncode, problem.strip()) == (code, "truetip: interrupted, nothing was written")
    until(lambda: not any(is_alive(each) for each in below), "end of all processes")
    assert {path.name for path in tmp_path.iterdir()} == {"temporary"}

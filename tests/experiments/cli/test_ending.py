"""Ctrl-C and SIGTERM while a robot moves: the first one asks, and its copies do not break the stop off."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from experiments.cli import ending
from experiments.cli.ending import asking
from tests.experiments.commands import RESULTS, SHORT, files


def test_signals_that_come_together_are_one_request_and_a_later_one_interrupts(monkeypatch):
    """A terminal sends Ctrl-C to all of its processes, and a program that started this one sends it again."""
    monkeypatch.setattr(ending, "_TOGETHER", 0.2)
    with asking() as end:
        for number in (signal.SIGINT, signal.SIGINT, signal.SIGTERM):
            os.kill(os.getpid(), number)
        assert end.is_asked()
        assert end.code == 130
        time.sleep(0.3)
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")
@pytest.mark.parametrize("more", [[], ["--json", "-"]])
def test_a_stdout_that_is_full_costs_no_result(more: list[str], tmp_path: Path):
    out = tmp_path / "out"
    command = ["compare", "--laws=open_loop", "--cycles=1", *SHORT, f"--out={out}", *more]
    with open("/dev/full", "w") as full:
        result = subprocess.run(
            [sys.executable, "-m", "experiments.main", *command],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert (result.returncode, result.stderr.splitlines()[-1]) == (
        1,
        "truetip: cannot write to stdout: no space left on device",
    )
    assert "Traceback" not in result.stderr
    assert files(out) == RESULTS


def test_a_reader_that_has_seen_enough_ends_a_command_quietly():
    command = [sys.executable, "-m", "experiments.main", "scenarios"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout
        assert process.stderr
        process.stdout.close()
        assert process.stderr.read() == b""

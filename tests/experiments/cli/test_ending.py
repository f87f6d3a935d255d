"""Ctrl-C and SIGTERM while a robot moves: the first one asks, and its copies do not break the stop off."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from experiments.cli import ending
from experiments.cli.ending import TerminatedError, asking, insisting
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_reader_that_has_seen_enough_ends_a_command_quietly():
    command = [sys.executable, "-m", "experiments.main", "scenarios"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout
        assert process.stderr
        process.stdout.close()
        assert process.stderr.read() == b""


def test_ctrl_c_while_python_ends_shows_no_traceback():
    code = (
        "import atexit, os, signal, sys; from experiments.main import main; "
        "sys.argv = ['truetip', '--version']; atexit.register(os.kill, os.getpid(), signal.SIGINT); main()"
    )
    result = subprocess.run([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True)
    assert (result.returncode, result.stderr) == (-signal.SIGINT, "")


WORK = """
import signal, time
from experiments.cli.workers import in_processes

def work(job, progress):
    for share in range(50):
        time.sleep(0.02)
        progress(0.02 * share)

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # which is ignored in the background
    in_processes(work, range(50), 1, lambda share: share and print(share, flush=True))
"""


@pytest.mark.parametrize("gap", [0.0, 0.01, 0.2])
def test_ctrl_c_that_comes_twice_ends_the_processes_and_does_not_wait_for_ever(gap: float, tmp_path: Path):
    script = tmp_path / "script.py"
    script.write_text(WORK)
    with subprocess.Popen(
        [sys.executable, script],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([os.getcwd(), os.environ.get("PYTHONPATH", "")])},
    ) as process:
        assert process.stdout
        process.stdout.readline()
        for pause in (gap, 0.0):
            process.send_signal(signal.SIGINT)
            time.sleep(pause)
        try:
            _, said = process.communicate(timeout=30)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == -signal.SIGINT
    assert said.strip().endswith("KeyboardInterrupt")


@pytest.fixture
def heard():
    """Ctrl-C is heard as in the foreground; in the background it is ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heard")
@pytest.mark.parametrize(
    ("number", "error"), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, TerminatedError)]
)
def test_who_swallows_an_interrupt_is_interrupted_again(number: int, error: type[BaseException]):
    """As the optimiser of a plan does, which then went on for minutes."""

    def swallowing() -> None:
        with insisting():
            with contextlib.suppress(KeyboardInterrupt):
                os.kill(os.getpid(), number)
                time.sleep(5.0)
            time.sleep(5.0)

    before = [signal.getsignal(each) for each in (number, signal.SIGALRM)]
    began = time.monotonic()
    with pytest.raises(error):
        swallowing()
    assert time.monotonic() - began < 3.0
    time.sleep(0.5)  # and not once more
    assert [signal.getsignal(each) for each in (number, signal.SIGALRM)] == before

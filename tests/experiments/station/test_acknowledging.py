"""Who lets a robot go on after a stop: by a signal or at the terminal, for a moment."""

import os
import pty
import signal
import sys
import time

import pytest

from experiments.station.acknowledging import Acknowledgement, acknowledging


def test_it_counts_for_a_moment_only():
    clock = [10.0]
    given = Acknowledgement(lambda: clock[0])
    assert not given.is_given()
    given.give()
    assert given.is_given()
    clock[0] += 1.0
    assert not given.is_given()


def test_a_signal_acknowledges_and_one_that_comes_too_late_ends_nothing():
    with acknowledging() as given:
        os.kill(os.getpid(), signal.SIGUSR1)
        assert given._until > 0.0
    os.kill(os.getpid(), signal.SIGUSR1)


def test_enter_at_a_terminal_acknowledges(monkeypatch: pytest.MonkeyPatch):
    master, slave = pty.openpty()
    with os.fdopen(slave) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        monkeypatch.setattr(os, "tcgetpgrp", lambda fd: os.getpgrp())
        with acknowledging() as given:
            os.write(master, b"\n")
            patience = time.monotonic() + 10.0
            while given._until < 0.0 and time.monotonic() < patience:
                time.sleep(0.01)
        assert given._until > 0.0
    os.close(master)

"""Ctrl-C and SIGTERM while a robot moves: the first one asks, and its copies do not break the stop off."""

import os
import signal
import time

import pytest

from experiments.cli import ending
from experiments.cli.ending import asking


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

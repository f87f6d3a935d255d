"""Before all others where that is permitted, as before afterwards, and a line that says what to permit."""

import os
import subprocess
import sys

import pytest

from diagrams import real_time_priority as module
from diagrams.real_time_priority import real_time_priority

pytestmark = pytest.mark.real_time


@pytest.mark.slow
def test_inside_the_process_comes_first_and_its_children_do_not():
    try:
        with real_time_priority(3):
            inside = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK, os.sched_getparam(0).sched_priority
            ask = "import os; print(os.sched_getscheduler(0))"
            child = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True)
            with open("/proc/self/status") as status:
                locked = next(line for line in status if line.startswith("VmLck"))
    except ValueError as error:
        pytest.skip(str(error))
    assert inside == (os.SCHED_FIFO, 3)
    assert int(child.stdout) == os.SCHED_OTHER
    assert int(locked.split()[1]) > 0
    assert os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_OTHER


def test_who_may_not_is_told_the_line_that_permits_it(monkeypatch: pytest.MonkeyPatch):
    def refuse(*given):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(module.os, "sched_setscheduler", refuse)
    line = r"add the line '\S+ - rtprio 80' to /etc/security/limits\.conf"
    with pytest.raises(ValueError, match=line), real_time_priority(80):
        pass


@pytest.mark.parametrize("priority", [0, 100, -3])
def test_a_priority_is_a_number_that_the_kernel_knows(priority: int):
    with pytest.raises(ValueError, match=f"from 1 to 99, got {priority}"), real_time_priority(priority):
        pass

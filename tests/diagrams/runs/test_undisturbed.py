"""Short slices of time and no garbage collection inside, all as before afterwards, children not affected."""

import gc
import os
import subprocess
import sys
from pathlib import Path

import pytest

from diagrams.runs.undisturbed import undisturbed

_ASK = "print(next((line for line in open('/proc/self/sched') if 'slice' in line), ''))"


def _slice() -> str:
    """As the kernel says it of this process; skips where it does not."""
    try:
        text = Path("/proc/self/sched").read_text()
    except OSError:
        pytest.skip("the kernel does not tell the slice of time")
    if not (lines := [line for line in text.splitlines() if "slice" in line]):
        pytest.skip("the kernel knows no slices of time")
    return lines[0].split(":")[1].strip()


def test_slices_are_short_inside_and_as_before_afterwards():
    before = _slice()
    with undisturbed():
        inside = _slice()
        child = subprocess.check_output([sys.executable, "-c", _ASK], text=True)
    if inside == before:
        pytest.skip("the kernel gives no slices of another length")
    assert inside == "100000"
    assert child.split(":")[1].strip() == before == _slice()


def test_a_real_time_priority_is_not_touched():
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    except PermissionError:
        pytest.skip("no permission for a real-time priority")
    try:
        with undisturbed():
            assert os.sched_getscheduler(0) == os.SCHED_RR
        assert os.sched_getscheduler(0) == os.SCHED_RR
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def test_no_garbage_is_collected_inside_also_where_it_raises():
    switching = sys.getswitchinterval()

    @undisturbed()
    def fails() -> None:
        assert not gc.isenabled()
        raise ValueError("inside")

    with pytest.raises(ValueError, match="inside"):
        fails()
    assert gc.isenabled()
    assert sys.getswitchinterval() == switching

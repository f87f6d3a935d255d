"""The process before all others of this machine, its memory held: what a station at 250 Hz asks of a host."""

import ctypes
import getpass
import os
from collections.abc import Iterator
from contextlib import contextmanager

_ALL = 1 | 2  # MCL_CURRENT | MCL_FUTURE of mlockall(2)
_TOUCHED = 64 << 20  # bytes that are taken and written to beforehand, so that a tick need not wait for them
_PAGE = 4096


@contextmanager
def real_time_priority(priority: int | None) -> Iterator[None]:
    """Runs what is inside under SCHED_FIFO with all memory locked; None changes nothing.

    Processes that are started meanwhile have no such priority.

    Args:
        priority: 1 to 99, larger before smaller.

    Raises:
        ValueError: if there is no such priority, or it is not permitted; says what to permit and where.
    """
    if priority is None:
        yield
        return
    if not 1 <= priority <= 99:
        raise ValueError(f"--realtime must be a priority from 1 to 99, got {priority}")
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except PermissionError as error:
        raise ValueError(_not_permitted(f"priority {priority}", f"rtprio {priority}")) from error
    libc = ctypes.CDLL(None, use_errno=True)
    try:
        if libc.mlockall(_ALL) != 0:
            raise ValueError(_not_permitted("locked memory", "memlock unlimited"))
        touched = bytearray(_TOUCHED)
        touched[::_PAGE] = b"\1" * len(touched[::_PAGE])
        del touched
        yield
    finally:
        libc.munlockall()
        os.sched_setscheduler(0, *before)


def _not_permitted(what: str, permission: str) -> str:
    return (
        f"--realtime: this user is not permitted {what}; add the line '{getpass.getuser()} - {permission}' "
        "to /etc/security/limits.conf and log in again"
    )

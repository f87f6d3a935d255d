"""A process that answers messages, as little disturbed as it may be without asking for a priority."""

import ctypes
import gc
import os
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager

_SWITCH = 5e-4  # s after which another thread, such as that of a progress bar, gives way
_SLICE = 100_000  # ns, the shortest that Linux gives
# Numbers of sched_setattr and sched_getattr, which glibc before 2.41 has no names for.
_CALLS = {"x86_64": (314, 315), "aarch64": (274, 275)}
_RESET_ON_FORK = 1


class _Attributes(ctypes.Structure):
    """``struct sched_attr`` of sched_setattr(2), as Linux 3.14 has it."""

    _fields_ = (
        ("size", ctypes.c_uint32),
        ("policy", ctypes.c_uint32),
        ("flags", ctypes.c_uint64),
        ("nice", ctypes.c_int32),
        ("priority", ctypes.c_uint32),
        ("runtime", ctypes.c_uint64),
        ("deadline", ctypes.c_uint64),
        ("period", ctypes.c_uint64),
    )


@contextmanager
def undisturbed() -> Iterator[None]:
    """Runs what is inside without garbage collection and with short time slices; as before afterwards.

    A full search for garbage takes tens of milliseconds with Drake loaded. And whoever asks Linux (6.12 and
    newer) for short slices of time gets no more of the processor for it, but gets it sooner when a message
    arrives. Older kernels and a process with real-time priority know no slices; nothing changes there.
    """
    collecting, switching = gc.isenabled(), sys.getswitchinterval()
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(_SWITCH)
    before = _ask_for_slice(_SLICE)
    try:
        yield
    finally:
        _ask_for_slice(before)
        sys.setswitchinterval(switching)
        gc.unfreeze()
        if collecting:
            gc.enable()


def _ask_for_slice(nanoseconds: int | None) -> int | None:
    """Of this thread; returns the one before, None where there are none.

    Processes that are started from then on have the usual one: who may not raise priorities may not take
    that back either.
    """
    calls = _CALLS.get(platform.machine())
    if nanoseconds is None or sys.platform != "linux" or calls is None:
        return None
    if os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK != os.SCHED_OTHER:
        return None
    system, attributes = ctypes.CDLL(None), _Attributes()
    size = attributes.size = ctypes.sizeof(attributes)
    if system.syscall(calls[1], 0, ctypes.byref(attributes), size, 0) != 0:
        return None
    before, attributes.runtime = attributes.runtime, nanoseconds
    attributes.flags |= _RESET_ON_FORK
    # Where a sandbox forbids it, all stays as it was.
    system.syscall(calls[0], 0, ctypes.byref(attributes), 0)
    return before or None

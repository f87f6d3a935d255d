"""Looks at the machine: versions, cores, timers, ports, and parts that need not be there."""

import os
import platform
import re
import shutil
import socket
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec

from diagrams.scenario.scenario import load_scenario
from robots.threads import usable_cores
from systems.link.qualisys.messages import PORT as CAMERA_PORT

GOOD, OPTIONAL, BAD = "ok", "optional", "missing"
_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "firefox")
_NAPS, _NAP = 100, 2e-3  # how often and for how many seconds to sleep
_LATE = 2e-3  # s, half a cycle of EGM and RSI


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    name: str
    state: str  # `GOOD`, `OPTIONAL`: works without it; `BAD`: needed
    found: str  # what there is
    advice: str = ""  # what to do about it


def findings() -> Iterator[Finding]:
    """Everything, in the order in which it is shown; takes about half a second."""
    yield python()
    yield from packages()
    yield cores()
    yield threads()
    yield timer()
    yield real_time()
    yield browser()
    yield from ports()
    yield from extras()


def python() -> Finding:
    """The interpreter."""
    state = GOOD if sys.version_info >= (3, 11) else BAD
    return Finding("Python", state, platform.python_version(), "" if state == GOOD else "3.11 or newer")


def packages() -> Iterator[Finding]:
    """truetip and what it needs, with their versions."""
    yield _package("truetip", "make demo, or pip install truetip")
    try:
        needed = [line for line in requires("truetip") or [] if "extra ==" not in line]
    except PackageNotFoundError:
        return
    for line in needed:
        name = re.split(r"[^\w.-]", line, maxsplit=1)[0]
        yield _package(name, f"pip install '{line}'")


def _package(name: str, advice: str) -> Finding:
    try:
        return Finding(name, GOOD, version(name))
    except PackageNotFoundError:
        return Finding(name, BAD, "not installed", advice)


def cores() -> Finding:
    """Of how many cores comparisons and studies make use."""
    usable, all_of_them = usable_cores(), os.cpu_count() or 1
    found = f"{usable} of {all_of_them}" if usable < all_of_them else f"{usable}"
    return Finding("cores", GOOD, found, "" if usable > 1 else "runs go one after another")


def threads() -> Finding:
    """Whether linear algebra takes threads of its own, which slows down small matrices."""
    said = os.environ.get("OMP_NUM_THREADS", "")
    if said == "1":
        return Finding("threads of linear algebra", GOOD, "1")
    advice = "OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 makes single runs faster"
    return Finding("threads of linear algebra", OPTIONAL, said or "as many as cores", advice)


def timer() -> Finding:
    """How late this process wakes up: what real stations feel of this machine."""
    late = []
    for _ in range(_NAPS):
        before = time.monotonic()
        time.sleep(_NAP)
        late.append(time.monotonic() - before - _NAP)
    worst, median = max(late), sorted(late)[_NAPS // 2]
    found = f"{1e3 * worst:.2f} ms late at worst of {_NAPS}, {1e3 * median:.2f} ms in the median"
    busy = "for a real robot the machine should do nothing else" if worst > _LATE else ""
    return Finding("timer", OPTIONAL if busy else GOOD, found, busy)


def real_time() -> Finding:
    """Whether this user may ask for real-time priority."""
    try:
        import resource

        allowed, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
    except (ImportError, AttributeError):
        return Finding("real-time priority", OPTIONAL, f"not known on {platform.system()}")
    if allowed or os.geteuid() == 0:
        return Finding("real-time priority", GOOD, "allowed", "chrt -f 50 truetip ... for a real robot")
    advice = "a line 'USER - rtprio 80' in /etc/security/limits.conf, then chrt -f 50 truetip ..."
    return Finding("real-time priority", OPTIONAL, "not allowed", advice)


def browser() -> Finding:
    """What opens reports; tests look at them in Chromium."""
    found = next(filter(None, map(shutil.which, _BROWSERS)), None)
    if found:
        return Finding("browser", GOOD, found)
    return Finding("browser", OPTIONAL, "none found", "reports open in any; tests of pages need Chromium")


def ports() -> Iterator[Finding]:
    """Whether the ports are free on which controllers and cameras are expected."""
    links = [load_scenario(name).station.link for name in ("cell", "cell-kuka")]
    wanted = [(f"port {link.port} (UDP), {link.title}", socket.SOCK_DGRAM, link.port) for link in links]
    wanted.append((f"port {CAMERA_PORT} (TCP), virtual camera", socket.SOCK_STREAM, CAMERA_PORT))
    for name, kind, port in wanted:
        with socket.socket(socket.AF_INET, kind) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError as error:
                reason = (error.strerror or str(error)).lower()
                yield Finding(name, OPTIONAL, reason, "--set station.link.port=N takes another one")
            else:
                yield Finding(name, GOOD, "free")


def extras() -> Iterator[Finding]:
    """Parts that come with an extra of their own."""
    for name, module, use, how in (
        ("cluster", "distributed", "runs on the workers of a cluster", "pip install 'truetip[cluster]'"),
        ("manual", "material", "make docs", "pip install 'truetip[docs]'"),
    ):
        if find_spec(module):
            yield Finding(name, GOOD, use)
        else:
            yield Finding(name, OPTIONAL, "not installed", f"{how}: {use}")

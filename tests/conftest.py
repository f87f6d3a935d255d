"""What all tests share: the same examples of hypothesis in every run, and patience with the clock."""

import fcntl
import tempfile
from collections.abc import Generator
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("truetip", derandomize=True, deadline=None, database=None)
settings.load_profile("truetip")


class Processors:
    """The tests of all workers share them, until one asks for all."""

    def __init__(self, run: str) -> None:
        folder = Path(tempfile.gettempdir())
        self.paths = [folder / f"truetip-tests-{run}-{name}.lock" for name in ("queue", "processors")]
        self._queue, self._all = (path.open("w") for path in self.paths)

    def take(self, how: int) -> None:
        """Waits in a queue, so that who wants all is not overtaken by those who share."""
        self.release()
        fcntl.flock(self._queue, fcntl.LOCK_EX)
        fcntl.flock(self._all, how)
        fcntl.flock(self._queue, fcntl.LOCK_UN)

    def release(self) -> None:
        fcntl.flock(self._all, fcntl.LOCK_UN)


PROCESSORS = pytest.StashKey[Processors]()


def pytest_configure(config: pytest.Config) -> None:
    """Without workers a test is alone anyhow."""
    worker = getattr(config, "workerinput", None)
    if worker is not None:
        config.stash[PROCESSORS] = Processors(worker["testrunuid"])


def pytest_unconfigure(config: pytest.Config) -> None:
    if PROCESSORS in config.stash:
        for path in config.stash[PROCESSORS].paths:
            path.unlink(missing_ok=True)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What keeps the time of the clock may fail where other work took the processor: it runs again, alone."""
    for item in items:
        if item.get_closest_marker("real_time") is not None:
            item.add_marker(pytest.mark.flaky(reruns=2))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    processors = item.config.stash.get(PROCESSORS, None)
    if processors is None:
        return (yield)
    processors.take(fcntl.LOCK_SH)
    try:
        return (yield)
    finally:
        processors.release()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    processors = item.config.stash.get(PROCESSORS, None)
    if processors is not None and getattr(item, "execution_count", 1) > 1:
        processors.take(fcntl.LOCK_EX)

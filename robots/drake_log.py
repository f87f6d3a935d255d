"""What Drake itself says on the console."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def quiet_drake(level: int = logging.WARNING) -> Iterator[None]:
    """Keeps Drake from saying what is below a level of `logging` in this block."""
    log = logging.getLogger("drake")
    before = log.level
    log.setLevel(level)
    try:
        yield
    finally:
        log.setLevel(before)

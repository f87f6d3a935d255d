"""Rows that wait on the disk come back as they were, also those that the disk did not take."""

import errno
import tracemalloc

import numpy as np
import pytest

from diagrams.record.spool import Spool


def rows(count: int) -> np.ndarray:
    return np.random.default_rng(0).normal(size=(count, 40))


def test_rows_come_back_in_order_and_more_may_follow():
    spool, given = Spool(40), rows(1000)
    for row in given[:600]:
        spool.append(*np.split(row, [1, 7]))
    np.testing.assert_array_equal(spool.read(), given[:600])
    for row in given[600:]:
        spool.append(row)
    np.testing.assert_array_equal(spool.read(), given)
    assert len(spool) == 1000


def test_memory_stays_what_it_was():
    """Ten minutes at 248 Hz would be 48 MB."""
    spool, given = Spool(40), rows(100)
    tracemalloc.start()
    for _ in range(200):
        for row in given:
            spool.append(row)
    size, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert size < 0.2e6


def test_a_full_disk_loses_no_row(monkeypatch: pytest.MonkeyPatch):
    spool, given = Spool(40), rows(1000)

    class Full:
        def write(self, data) -> int:
            if file.tell() > 100_000:
                raise OSError(errno.ENOSPC, "No space left on device")
            return file.write(data[: len(data) // 2])

    file = spool._file
    full = Full()
    for name in ("read", "seek"):
        setattr(full, name, getattr(file, name))
    monkeypatch.setattr(spool, "_file", full)
    for row in given:
        spool.append(row)
    np.testing.assert_array_equal(spool.read(), given)


def test_a_row_of_another_width_is_refused():
    with pytest.raises(ValueError, match="a row has 40 numbers, got 3"):
        Spool(40).append(np.zeros(3))

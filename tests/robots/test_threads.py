"""Threads of a process: as many as are allowed, and the same results with any number."""

import threading
import time

import pytest

from robots.threads import at_most, side_by_side


def seen(allowed: int | None) -> tuple[list[int], int]:
    """Results of 12 cases, and how many of them were under way at a time."""
    lock, now, most = threading.Lock(), 0, 0

    def work(case: int) -> int:
        nonlocal now, most
        with lock:
            now += 1
            most = max(most, now)
        time.sleep(0.01)
        with lock:
            now -= 1
        return case * case

    with at_most(allowed):
        return side_by_side(work, range(12)), most


@pytest.mark.parametrize("allowed", [1, 2, 5])
def test_no_more_cases_at_a_time_than_allowed(allowed: int):
    results, most = seen(allowed)
    assert results == [case * case for case in range(12)]
    assert most <= allowed


def test_a_limit_ends_with_its_block():
    with at_most(4):
        assert seen(1)[1] == 1
        assert side_by_side(abs, [-1, 2]) == [1, 2]

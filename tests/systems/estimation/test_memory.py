"""Named arrays in a vector, and rows that are found by time."""

import numpy as np
import pytest

from systems.estimation.memory import History, Layout


def test_arrays_are_windows_of_the_vector():
    layout = Layout(a=(2, 3), inner=Layout(b=(1,), c=(2,)))
    vector = np.zeros(layout.size)
    memory = layout.view(vector)
    memory.a[1, 2], memory.inner.c[0] = 5.0, 7.0
    assert vector.tolist() == [0, 0, 0, 0, 0, 5, 0, 7, 0]


@pytest.mark.parametrize("count", [3, 5, 17])
def test_rows_are_found_by_time_whatever_was_added_twice(count):
    history = History(1, 5)
    memory = history.layout.view(np.zeros(history.layout.size))
    for k in range(count):
        assert history.append(memory, 0.1 * k, np.array([float(k)]))
        assert not history.append(memory, 0.1 * k, np.array([-1.0]))

    def row(time):
        found = history.at(memory, time)
        assert found is not None
        return found[0]

    newest, oldest = count - 1.0, max(0.0, count - 5.0)
    for k in np.linspace(oldest, newest, 9):
        assert row(0.1 * k) == pytest.approx(k)
    assert row(-1.0) == oldest
    assert row(99.0) == newest


def test_an_empty_history_has_no_row():
    history = History(1, 5)
    assert history.at(history.layout.view(np.zeros(history.layout.size)), 0.0) is None

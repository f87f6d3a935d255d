"""Named arrays in one vector, so that what an estimator remembers can be a discrete state of the Context."""

import math
from types import SimpleNamespace

import numpy as np

from systems.estimation import kernels


class Layout:
    """Names and shapes of arrays that lie behind each other in a vector; a nested layout is one of them."""

    def __init__(self, **shapes: "tuple[int, ...] | Layout") -> None:
        """Lays the arrays out in the order of the arguments."""
        self._places: list[tuple[str, slice, tuple[int, ...] | Layout]] = []
        start = 0
        for name, shape in shapes.items():
            size = shape.size if isinstance(shape, Layout) else int(np.prod(shape, dtype=int))
            self._places.append((name, slice(start, start + size), shape))
            start += size
        self.size = start

    def view(self, vector: np.ndarray) -> SimpleNamespace:
        """The arrays as attributes; they are windows of the vector, which is ``all``, and not copies.

        Args:
            vector: shape (size,), contiguous.
        """
        windows = SimpleNamespace(all=vector)
        attributes = windows.__dict__
        for name, place, shape in self._places:
            part = vector[place]
            attributes[name] = shape.view(part) if isinstance(shape, Layout) else part.reshape(shape)
        return windows


class Views:
    """The views of few vectors, kept: what lies in the Context is at the same places tick after tick.

    A view has no state of its own. It is as good as new as long as the vector begins where it did.
    """

    _MOST = 8

    def __init__(self, layout: Layout) -> None:
        """Has none yet; what finds them is compiled before the first is asked for."""
        kernels.history.address(np.empty(1))
        self._layout = layout
        self._views: dict[int, SimpleNamespace] = {}

    def __call__(self, vector: np.ndarray) -> SimpleNamespace:
        """`Layout.view`."""
        place = kernels.history.address(vector)
        found = self._views.get(place)
        if found is None:
            if len(self._views) == self._MOST:
                self._views.clear()
            found = self._views[place] = self._layout.view(vector)
        return found


class History:
    """The last rows of numbers with their times, found again by time."""

    def __init__(self, columns: int, length: int) -> None:
        """Remembers ``length`` rows of ``columns`` numbers."""
        self.length = length
        self.layout = Layout(count=(1,), times=(length,), rows=(length, columns))

    def append(self, memory: SimpleNamespace, time: float, row: np.ndarray) -> bool:
        """Adds a row; one that is not later than the newest is left out, and False is the answer."""
        count = int(memory.count[0])
        if count and time <= memory.times[(count - 1) % self.length] + 1e-9:
            return False
        place = count % self.length
        memory.times[place], memory.rows[place] = time, row
        memory.count[0] = count + 1
        return True

    def since(self, memory: SimpleNamespace) -> float:
        """From which time in s on all rows are there; minus infinity as long as none has been forgotten."""
        count = int(memory.count[0])
        return float(memory.times[count % self.length]) if count > self.length else -math.inf

    def ordered(self, memory: SimpleNamespace) -> tuple[np.ndarray, np.ndarray]:
        """Times in s, (n,), and rows, (n, width), from the oldest to the newest; copies."""
        count = int(memory.count[0])
        first = count % self.length if count > self.length else 0
        order = (first + np.arange(min(count, self.length))) % self.length
        return memory.times[order], memory.rows[order]

    def at(self, memory: SimpleNamespace, time: float) -> np.ndarray | None:
        """The row at a time, linear between rows and constant outside; None if there is none."""
        count = int(memory.count[0])
        if not count:
            return None
        row = np.empty(memory.rows.shape[1])
        kernels.history.row_at(count, memory.times, memory.rows, time, row)
        return row

"""Named arrays in one vector, so that what an estimator remembers can be a discrete state of the Context."""

from types import SimpleNamespace

import numpy as np


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
        """The arrays as attributes; they are windows of the vector and not copies.

        Args:
            vector: shape (size,), contiguous.
        """
        windows = SimpleNamespace()
        attributes = windows.__dict__
        for name, place, shape in self._places:
            part = vector[place]
            attributes[name] = shape.view(part) if isinstance(shape, Layout) else part.reshape(shape)
        return windows


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

    def ordered(self, memory: SimpleNamespace) -> tuple[np.ndarray, np.ndarray]:
        """Times and rows from the oldest to the newest; copies."""
        count = int(memory.count[0])
        first = count % self.length if count > self.length else 0
        order = (first + np.arange(min(count, self.length))) % self.length
        return memory.times[order], memory.rows[order]

    def around(self, memory: SimpleNamespace, time: float) -> tuple[int, int, float] | None:
        """The places of the rows before and after a time, and the share of the way from one to the other.

        Before the oldest row and after the newest one both are that row. None if there is no row.
        """
        count = int(memory.count[0])
        if not count:
            return None
        held, first = min(count, self.length), count % self.length if count > self.length else 0
        times = memory.times
        newest = (count - 1) % self.length
        if time >= times[newest]:
            return newest, newest, 0.0
        ordered = np.concatenate((times[first:held], times[:first])) if first else times[:held]
        after = int(ordered.searchsorted(time, side="right"))
        if after == 0:
            return first, first, 0.0
        before, behind = (first + after - 1) % self.length, (first + after) % self.length
        return before, behind, float((time - times[before]) / (times[behind] - times[before]))

    def at(self, memory: SimpleNamespace, time: float) -> np.ndarray | None:
        """The row at a time, linear between rows and constant outside; None if there is none."""
        place = self.around(memory, time)
        if place is None:
            return None
        before, behind, share = place
        if share == 0.0:
            return memory.rows[before].copy()
        return (1.0 - share) * memory.rows[before] + share * memory.rows[behind]

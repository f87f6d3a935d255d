"""Rows of numbers on the disk while a run goes on, so that a night takes no more memory than a minute."""

import tempfile

import numpy as np
from pydrake.systems.framework import Context, OutputPort

_BUFFER = 1 << 16  # bytes


class Spool:
    """Rows of one width, in a file without a name that goes with the process."""

    def __init__(self, width: int) -> None:
        """Opens the file. Raises OSError if there is none to be had.

        Args:
            width: numbers of a row.
        """
        self.width, self._count = width, 0
        self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - it goes with this object
        self._pending = bytearray()  # also what a full disk does not take: the run goes on with its record
        self._is_full = False

    def __len__(self) -> int:
        return self._count

    def append(self, *parts: np.ndarray | float) -> None:
        """Adds a row, given in parts that are put side by side. Raises ValueError if its width is another."""
        row = np.hstack(parts).astype(float, copy=False)
        if row.shape != (self.width,):
            raise ValueError(f"spool: a row has {self.width} numbers, got {row.size}")
        self._count += 1
        self._pending += row.tobytes()
        if len(self._pending) >= _BUFFER and not self._is_full:
            try:
                del self._pending[: self._file.write(self._pending)]
            except OSError:
                self._is_full = True

    def read(self) -> np.ndarray:
        """All rows, shape (n, width)."""
        self._file.seek(0)
        rows = np.frombuffer(self._file.read() + self._pending).reshape(-1, self.width).copy()
        self._file.seek(0, 2)
        return rows


class SpooledLog:
    """Vector ports of one system side by side, noted when one says so; else as `PackedLog`."""

    def __init__(self, ports: dict[str, OutputPort]) -> None:
        """Takes the ports by name, all of one system."""
        self._ports = list(ports.values())
        self._sizes = {name: port.size() for name, port in ports.items()}
        self._rows = Spool(1 + sum(self._sizes.values()))

    def values(self, context: Context) -> list[np.ndarray]:
        """What stands at the ports, in a context of their system."""
        return [port.Eval(context) for port in self._ports]

    def note(self, context: Context) -> None:
        """Logs what stands at the ports, in a context of their system."""
        self._rows.append(context.get_time(), *self.values(context))

    def read(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """The times, shape (n,), and by name what was logged, shape (n, size) each."""
        rows = self._rows.read()
        columns = np.split(rows[:, 1:], np.cumsum(list(self._sizes.values()))[:-1], axis=1)
        return rows[:, 0].copy(), dict(zip(self._sizes, columns, strict=True))

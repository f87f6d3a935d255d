"""A motion that was planned: a path with its own timing, from a file."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from robots.configuration.quantity import file_name
from systems.reference.planned_file import PlannedMotion, read_planned


@dataclass
class Planned:
    """The motion in a file of ``truetip plan --write``; acceleration and timing do not count."""

    kind: ClassVar[str] = "planned"
    file: str = file_name()  # as ``truetip plan --write`` makes it

    def __post_init__(self) -> None:
        """Has read nothing yet."""
        # Once for all runs of a command, in whatever process: the file may be written anew meanwhile.
        self._read: PlannedMotion | None = None

    def motion(self, forward: Callable[[np.ndarray], np.ndarray] | None = None) -> PlannedMotion:
        """What the file holds, which is read once, and anew to be compared with a robot.

        Arguments and errors as of `read_planned`, and ValueError if no file is named.
        """
        if not self.file:
            raise ValueError("reference: path planned needs a file, as truetip plan --write makes it")
        if self._read is None or forward is not None:
            self._read = read_planned(self.file, forward)
        return self._read

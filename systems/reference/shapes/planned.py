"""A motion that was planned: a path with its own timing, from a file."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from systems.reference.planned_file import PlannedMotion, read_planned


@dataclass
class Planned:
    """The motion in a file of ``truetip plan --write``; acceleration and timing do not count."""

    kind: ClassVar[str] = "planned"
    file: str = ""  # as ``truetip plan --write`` makes it

    def motion(self, forward: Callable[[np.ndarray], np.ndarray] | None = None) -> PlannedMotion:
        """What the file holds; arguments and errors as of `read_planned`, and ValueError if there is none."""
        if not self.file:
            raise ValueError("reference: path planned needs a file, as truetip plan --write makes it")
        return read_planned(self.file, forward)

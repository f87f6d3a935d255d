"""A motion that was planned: a path with its own timing, from a file."""

from dataclasses import dataclass
from typing import ClassVar

from systems.reference.planned_file import PlannedMotion, read_planned


@dataclass
class Planned:
    """The motion in a file of ``truetip plan --write``; acceleration and timing do not count."""

    kind: ClassVar[str] = "planned"
    file: str = ""  # as ``truetip plan --write`` makes it

    def motion(self) -> PlannedMotion:
        """What the file holds. Raises ValueError if there is none, or it is not readable."""
        if not self.file:
            raise ValueError("reference: path planned needs a file, as truetip plan --write makes it")
        return read_planned(self.file)

"""From set to set of images: who is in the cell, how fast they move, and what has stayed."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from systems.samples import ImageSample, PersonSample
from systems.vision.people.background import Memory
from systems.vision.people.lasting_changes import (
    LastingChange,
    Standing,
    lasting_changes,
    standing_still,
)
from systems.vision.people.people_detector import PeopleDetector
from systems.vision.people.person_tracks import Track, TrackConfig, followed


@dataclass(frozen=True)
class Mind:
    """What is remembered from one set of images to the next."""

    memory: Memory
    tracks: tuple[Track, ...] = ()
    next_number: int = 1
    sample: PersonSample = field(default_factory=PersonSample)
    standing: tuple[Standing, ...] = ()
    changes: tuple[LastingChange, ...] = ()

    def __deepcopy__(self, memo: dict[int, Any]) -> "Mind":
        """Itself, for nothing in it changes."""
        return self


class PeopleFollower:
    """Detects and follows; the same with a simulation and in a process beside a real station."""

    def __init__(self, detector: PeopleDetector, tracks: TrackConfig, lasting: float) -> None:
        """Takes its parts.

        Args:
            detector: what finds bodies.
            tracks: how people are followed.
            lasting: s at one place, after which a body is a change of the cell.
        """
        self.detector, self._tracks, self._lasting = detector, tracks, lasting

    def after(self, mind: Mind, images: ImageSample, q: np.ndarray) -> Mind:
        """What is remembered after a set of images.

        Args:
            mind: before.
            images: newer than those before.
            q: where the joints were at the exposure in rad, (6,).

        Raises:
            ValueError: if the images have another number or size than those of the detector.
        """
        edge = self.detector.edge
        seen, memory = self.detector.detect(mind.memory, images.images, q)
        tracks, people, number = followed(
            mind.tracks, mind.next_number, images.time, seen.bodies, edge, self._tracks
        )
        sample = PersonSample(images.time, seen.trusted, people)
        standing = standing_still(mind.standing, images.time, seen.bodies, edge)
        changes = lasting_changes(mind.changes, standing, images.time, images.images, self._lasting, edge)
        return Mind(memory, tracks, number, sample, standing, changes)

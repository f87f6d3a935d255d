"""What instruments say of a robot: coordinates of targets on its tool, or distances to them, line by line."""

from dataclasses import dataclass

import numpy as np

COORDINATES = 3  # slots of a line: x, y, z; a distance takes the first


@dataclass(frozen=True)
class Observations:
    """m lines about n configurations.

    A line is of one target and one instrument: the coordinates of the target in the frame of the instrument
    as far as they were seen, or its distance from the anchor of a ball bar or an interferometer.
    """

    q: np.ndarray  # (n, 6) rad, motor side
    row: np.ndarray  # (m,) configurations of the lines, indices
    target: np.ndarray  # (m,) indices into the names of targets
    instrument: np.ndarray  # (m,) indices into the names of instruments
    position: np.ndarray  # (m, 3) m; NaN where a coordinate is missing, and where a distance was measured
    distance: np.ndarray  # (m,) m; NaN where coordinates were
    sigma: np.ndarray  # (m,) m, standard deviation of each number; NaN where it is not known
    lines: np.ndarray  # (m,) where they stand in a file
    targets: tuple[str, ...]  # names
    instruments: tuple[str, ...]
    payload: np.ndarray | None = None  # (n,) kg at the flange; None for none

    def __post_init__(self) -> None:
        """Checks that every instrument measures one kind of thing, and every line something.

        Raises:
            ValueError: if one measures coordinates and distances, or a line holds neither or both.
        """
        has_distance, has_position = np.isfinite(self.distance), np.isfinite(self.position).any(axis=1)
        wrong = np.flatnonzero(has_distance == has_position)
        if len(wrong):
            line = int(self.lines[wrong[0]])
            raise ValueError(f"line {line}: needs coordinates or a distance, and not both")
        for number, name in enumerate(self.instruments):
            kinds = set(has_distance[self.instrument == number].tolist())
            if len(kinds) > 1:
                raise ValueError(f"instrument {name} measures coordinates and distances; give it two names")

    def __len__(self) -> int:
        """How many lines there are, m."""
        return len(self.row)

    @property
    def loads(self) -> np.ndarray:
        """Masses at the flange in kg, (n,)."""
        return np.zeros(len(self.q)) if self.payload is None else self.payload

    def is_bar(self, instrument: int) -> bool:
        """Whether an instrument measures distances."""
        return bool(np.isfinite(self.distance[self.instrument == instrument]).any())

    @property
    def numbers(self) -> np.ndarray:
        """What was measured in the slots of each line, NaN where nothing was, (m, 3)."""
        values = self.position.copy()
        has_distance = np.isfinite(self.distance)
        values[has_distance, 0] = self.distance[has_distance]
        return values


@dataclass(frozen=True)
class MeasuringCell:
    """What is known of targets and instruments before the measurement; what is not named is to be found."""

    places: dict[str, np.ndarray]  # of targets in the frame of the tool, m, (3,)
    frames: dict[str, np.ndarray]  # world of the robot in the frames of instruments, (4, 4)
    anchors: dict[str, np.ndarray]  # of distances in the world of the robot, m, (3,)
    sigmas: dict[str, float]  # of instruments, m
    joint_sigma: float | None = None  # rad

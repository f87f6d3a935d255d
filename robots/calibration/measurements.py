"""A table of measured poses: joint positions, payload, and where the tool was seen."""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from robots.description.model import NUM_JOINTS


@dataclass(frozen=True)
class MeasurementNoise:
    """Standard deviations of one row of a table: of each joint, each coordinate, each axis of rotation."""

    joint_sigma: float = 0.0  # rad
    position_sigma: float = 0.0  # m
    rotation_sigma: float = 0.0  # rad

    @property
    def is_known(self) -> bool:
        """Whether any of them is known; a table without noise tells nothing of its spread."""
        return max(self.joint_sigma, self.position_sigma, self.rotation_sigma) > 0.0


# Probst (2024), table 6.1. The column of the noise holds variances in deg^2 and mm^2: only with their roots
# do the figures of the source come out.
SOURCE_NOISE = MeasurementNoise(float(np.deg2rad(0.1)), 1e-4, float(np.deg2rad(0.03)))


@dataclass(frozen=True)
class Measurements:
    """Poses of the tool that were measured at joint positions, n rows."""

    q: np.ndarray  # (n, 6) rad, motor side
    position: np.ndarray  # (n, 3) m, of the tool in the world
    rotation: np.ndarray | None = None  # (n, 3, 3) of the tool in the world; None where it was not measured
    payload: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (n,) kg; empty for none
    rows: np.ndarray = field(
        default_factory=lambda: np.zeros(0, dtype=int)
    )  # (n,) where they stand in a file
    # (n, 3) standard deviations of joints, position and rotation of every row in rad, m, rad; a column of NaN
    # where they are not known; empty if none is
    sigmas: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        """Checks the shapes and fills in what was left out. Raises ValueError if they do not fit."""
        n = len(self.q)
        if not len(self.payload):
            object.__setattr__(self, "payload", np.zeros(n))
        if not len(self.rows):
            object.__setattr__(self, "rows", np.arange(1, n + 1))
        shapes = [self.q.shape, self.position.shape, self.payload.shape, self.rows.shape]
        if self.rotation is not None:
            shapes.append(self.rotation.shape)
        if len(self.sigmas) and self.sigmas.shape != (n, 3):
            shapes.append(self.sigmas.shape)
        if shapes[:4] != [(n, NUM_JOINTS), (n, 3), (n,), (n,)] or shapes[4:] not in ([], [(n, 3, 3)]):
            raise ValueError(f"measurements: shapes do not fit each other: {shapes}")

    def __len__(self) -> int:
        """How many rows there are."""
        return len(self.q)

    @property
    def X_WE(self) -> np.ndarray:
        """The measured poses as homogeneous matrices, (n, 4, 4); unit rotations where none was measured."""
        X = np.tile(np.eye(4), (len(self), 1, 1))
        X[:, :3, 3] = self.position
        if self.rotation is not None:
            X[:, :3, :3] = self.rotation
        return X

    def select(self, which: np.ndarray) -> "Measurements":
        """Some of the rows, by a mask or by indices."""
        rotation = None if self.rotation is None else self.rotation[which]
        sigmas = self.sigmas[which] if len(self.sigmas) else self.sigmas
        return Measurements(
            self.q[which], self.position[which], rotation, self.payload[which], self.rows[which], sigmas
        )

    def without_rotation(self) -> "Measurements":
        """The same table with positions only."""
        return replace(self, rotation=None)

    def joined(self, other: "Measurements") -> "Measurements":
        """Both tables below each other, numbered anew. Raises ValueError if only one has rotations."""
        if (self.rotation is None) != (other.rotation is None):
            raise ValueError("measurements: a table with rotations and one without cannot be joined")
        both = [
            np.concatenate([getattr(self, name), getattr(other, name)])
            for name in ("q", "position", "payload")
        ]
        rotation = None
        if self.rotation is not None and other.rotation is not None:
            rotation = np.concatenate([self.rotation, other.rotation])
        return Measurements(both[0], both[1], rotation, both[2])

    def noisy(self, noise: MeasurementNoise, rng: np.random.Generator) -> "Measurements":
        """The table as worse instruments would have written it: independent normal noise on every number."""
        q = self.q + noise.joint_sigma * rng.normal(size=self.q.shape)
        position = self.position + noise.position_sigma * rng.normal(size=self.position.shape)
        rotation = self.rotation
        turns = Rotation.from_rotvec(noise.rotation_sigma * rng.normal(size=self.position.shape))
        if rotation is not None:
            rotation = turns.as_matrix() @ rotation
        return replace(self, q=q, position=position, rotation=rotation)

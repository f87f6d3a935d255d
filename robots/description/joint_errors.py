"""Errors of a joint that depend on where joints stand: of encoders, gears and wrists.

``scale_i`` is the share by which joint i turns more than its encoder tells; ``sine_i`` and ``cosine_i`` are
the amplitudes in rad of an eccentric disc or gear, once per turn; ``coupling_ij`` is the share of joint i's
angle that joint j turns along, as in a wrist whose gears run through each other. They add to the joint angle.
"""

from collections.abc import Sequence

import numpy as np

_JOINTS = range(1, 7)
_COUPLED = ("45", "46", "56")
KINDS = {
    "scale": tuple(f"scale_{i}" for i in _JOINTS),
    "eccentricity": tuple(f"{kind}_{i}" for kind in ("sine", "cosine") for i in _JOINTS),
    "coupling": tuple(f"coupling_{pair}" for pair in _COUPLED),
}
ALL = tuple(name for names in KINDS.values() for name in names)


def names_of(kinds: Sequence[str]) -> tuple[str, ...]:
    """Names of all errors of some kinds, in the order of `KINDS`.

    Raises:
        ValueError: if a kind is unknown.
    """
    for kind in kinds:
        if kind not in KINDS:
            raise ValueError(f"joint errors are {', '.join(KINDS)}, got '{kind}'")
    return tuple(name for kind, names in KINDS.items() if kind in kinds for name in names)


class JointErrors:
    """How some of the errors move the joints."""

    def __init__(self, names: Sequence[str]) -> None:
        """Takes the names.

        Raises:
            ValueError: if one is unknown.
        """
        unknown = [name for name in names if name not in ALL]
        if unknown:
            raise ValueError(f"joint errors: '{unknown[0]}' is none of {', '.join(ALL)}")
        self.joint = np.array([int(name[-1]) - 1 for name in names], dtype=int)  # that is moved
        self.source = np.array([int(name.partition("_")[2][0]) - 1 for name in names], dtype=int)
        self._is_sine = np.array([name.startswith("sine") for name in names], dtype=bool)
        self._is_cosine = np.array([name.startswith("cosine") for name in names], dtype=bool)
        self._moves = np.zeros((len(names), 6))
        self._moves[np.arange(len(names)), self.joint] = 1.0

    def effects(self, q: np.ndarray) -> np.ndarray:
        """What one of each adds to its joint at joint positions in rad, (..., 6) -> (..., m)."""
        angle = q[..., self.source]
        waves = np.where(self._is_sine, np.sin(angle), np.cos(angle))
        return np.where(self._is_sine | self._is_cosine, waves, angle)

    def added(self, q: np.ndarray, values: np.ndarray) -> np.ndarray:
        """What errors of some values (m,) add to joint positions in rad, (..., 6) -> (..., 6)."""
        return (self.effects(q) * values) @ self._moves

    def slope(self, q: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Derivative of `added` by the joint positions (6,), (6, 6)."""
        angle = q[self.source]
        waves = np.where(self._is_sine, np.cos(angle), -np.sin(angle))
        slopes = np.where(self._is_sine | self._is_cosine, waves, 1.0) * values
        J = np.zeros((6, 6))
        np.add.at(J, (self.joint, self.source), slopes)
        return J

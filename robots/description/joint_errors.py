"""Errors of a joint that depend on where joints stand: of encoders, gears and wrists.

``scale_i`` is the share by which joint i turns more than its encoder tells; ``sine_i`` and ``cosine_i`` are
the amplitudes in rad of an eccentric disc or gear, once per turn; ``motor_sine_i`` and ``motor_cosine_i``
those of what turns with the motor, once in each of its turns, ``wave_sine_i`` and ``wave_cosine_i`` twice in
each, as strain wave gears do; ``coupling_ij`` is the share of joint i's angle that joint j turns along, as in
a wrist whose gears run through each other. They add to the joint angle, and depend on the one that is read.
"""

from collections.abc import Sequence

import numpy as np

_JOINTS = range(1, 7)
_COUPLED = ("45", "46", "56")


def _waves(prefix: str) -> tuple[str, ...]:
    return tuple(f"{prefix}{kind}_{i}" for kind in ("sine", "cosine") for i in _JOINTS)


KINDS = {
    "scale": tuple(f"scale_{i}" for i in _JOINTS),
    "eccentricity": _waves(""),
    "motor": _waves("motor_"),
    "strain_wave": _waves("wave_"),
    "coupling": tuple(f"coupling_{pair}" for pair in _COUPLED),
}
ALL = tuple(name for names in KINDS.values() for name in names)
_PER_MOTOR_TURN = {"motor": 1.0, "wave": 2.0}


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

    def __init__(self, names: Sequence[str], gear_ratio: np.ndarray) -> None:
        """Takes the names.

        Args:
            names: some of `ALL`.
            gear_ratio: turns of the motors per turn of their joints, (6,).

        Raises:
            ValueError: if a name is unknown.
        """
        check_names(names)
        self.joint = np.array([int(name[-1]) - 1 for name in names], dtype=int)  # that is moved
        numbers = [name.rpartition("_")[2] for name in names]
        self.source = np.array([int(number[0]) - 1 for number in numbers], dtype=int)
        self._is_sine = np.array(["sine" in name and "cosine" not in name for name in names], dtype=bool)
        self._is_wave = np.array(["sine" in name for name in names], dtype=bool)
        per_turn = np.array([_PER_MOTOR_TURN.get(name.partition("_")[0], 0.0) for name in names])
        # How often a wave repeats in a turn of the joint.
        self._often = np.where(per_turn > 0.0, per_turn * np.asarray(gear_ratio)[self.joint], 1.0)
        self._moves = np.zeros((len(names), 6))
        self._moves[np.arange(len(names)), self.joint] = 1.0

    def effects(self, q: np.ndarray) -> np.ndarray:
        """What one of each adds to its joint at joint positions in rad, (..., 6) -> (..., m)."""
        angle = q[..., self.source]
        turned = self._often * angle
        waves = np.where(self._is_sine, np.sin(turned), np.cos(turned))
        return np.where(self._is_wave, waves, angle)

    def added(self, q: np.ndarray, values: np.ndarray) -> np.ndarray:
        """What errors of some values (m,) add to joint positions in rad, (..., 6) -> (..., 6)."""
        return (self.effects(q) * values) @ self._moves

    def slope(self, q: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Derivative of `added` by the joint positions (6,), (6, 6)."""
        turned = self._often * q[self.source]
        waves = self._often * np.where(self._is_sine, np.cos(turned), -np.sin(turned))
        slopes = np.where(self._is_wave, waves, 1.0) * values
        J = np.zeros((6, 6))
        np.add.at(J, (self.joint, self.source), slopes)
        return J


def check_names(names: Sequence[str]) -> None:
    """Raises ValueError if one of them is no error of a joint."""
    unknown = [name for name in names if name not in ALL]
    if unknown:
        raise ValueError(f"joint errors: '{unknown[0]}' is none of {', '.join(ALL)}")

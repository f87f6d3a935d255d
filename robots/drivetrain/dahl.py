"""Hysteresis of a gear on the side of the torque: elements of friction that yield before they slip."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np


@dataclass(frozen=True)
class DahlHysteresis:
    """Elements in parallel, each a spring in series with dry friction, rounded as Dahl's model rounds them.

    An element carries k z, where z' = x' - |x'| z / r follows the deflection x and never leaves +-r. It
    stores k z^2 / 2 and loses k z^2 |x'| / r: a closed cycle can only lose energy, and the loop is bounded.
    Eq. (2.19) of Reiner (2010), a play operator on the deflection, creates energy; many elements make the
    same loops as its sum of play operators.

    Arrays have the elements along their last axis.
    """

    stiffness: tuple[float, ...] | np.ndarray  # N m / rad of each element
    width: tuple[float, ...] | np.ndarray  # rad, r of each element

    invertible: ClassVar[bool] = True

    def __post_init__(self) -> None:
        stiffness, width = np.asarray(self.stiffness), np.asarray(self.width)
        if stiffness.shape != width.shape or not stiffness.size:
            raise ValueError("DahlHysteresis: stiffness and width must be equally many, one or more")
        if (stiffness < 0.0).any():
            raise ValueError(
                f"DahlHysteresis: stiffness must not be negative, or it would create energy, got "
                f"{stiffness.tolist()}"
            )
        if (width <= 0.0).any():
            raise ValueError(f"DahlHysteresis: width must be positive, got {width.tolist()}")

    def torque(self, z: np.ndarray) -> np.ndarray:
        """What the elements carry together in N m at their states z in rad."""
        return np.asarray(np.add.reduce(self.stiffness * z, axis=-1))

    def rate(self, z: np.ndarray, deflection_rate: np.ndarray) -> np.ndarray:
        """dz/dt in rad/s."""
        rate = np.asarray(deflection_rate)[..., None]
        return rate - np.abs(rate) * z / np.asarray(self.width)

    def energy(self, z: np.ndarray) -> np.ndarray:
        """Energy stored in J."""
        return np.asarray(0.5 * np.sum(self.stiffness * np.square(z), axis=-1))

    def moved(self, z: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """The states after the deflection has turned by some rad in one direction: the rate, integrated."""
        turn, width = np.asarray(turn)[..., None], np.asarray(self.width)
        end = np.sign(turn) * width
        return end + (z - end) * np.exp(-np.abs(turn) / width)

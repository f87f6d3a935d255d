"""What motors need beyond their feedforward, as parts that a planned motion tells ahead of time."""

import numpy as np

from robots.description.model import NUM_JOINTS

PARTS = 3  # Coulomb, viscous, constant
MEMORY = (PARTS + PARTS * PARTS) * NUM_JOINTS

# In shares of the believed friction, and rad/s^2 per inertia that the drives are tuned for.
_DOUBT = (0.5, 1.0, 0.05)  # at the beginning: friction is known to a half, the load to that acceleration
_WANDER = (0.01, 0.01, 0.005)  # in a tick; the load's so slow that ringing gears are not taken for it
_NOISE = 1.0  # rad/s^2, of a balance over one tick: what gears that ring give and take


class FrictionObserver:
    """A Kalman filter per motor with the parts of the disturbance as states that wander.

    Friction that is not as believed has the shape of friction: it changes its sign with the planned speed and
    ends with it. Only what is left is carried on as it is.
    """

    def __init__(self, coulomb: np.ndarray, viscous: np.ndarray, width: np.ndarray) -> None:
        """Takes friction in rad/s^2 and 1/s, as `Forecast` has it, and the width of its jump in rad/s."""
        self._coulomb, self._viscous, self._width = coulomb, viscous, width
        units = np.stack([coulomb, viscous, np.ones(NUM_JOINTS)], axis=1)
        doubt, wander = units * _DOUBT, units * _WANDER
        self._added = np.eye(PARTS) * (wander**2)[:, None]
        self.at_first = np.concatenate(
            [np.zeros(NUM_JOINTS * PARTS), (np.eye(PARTS) * (doubt**2)[:, None]).ravel()]
        )

    def updated(self, memory: np.ndarray, disturbance: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """The memory after a tick.

        Args:
            memory: parts and their covariances, (MEMORY,).
            disturbance: that was found in this tick, in rad/s^2, (6,).
            speed: planned, in rad/s, (6,).
        """
        parts, S = self._split(memory)
        h = self._shapes(speed)
        S = S + self._added
        Sh = (S @ h[:, :, None])[:, :, 0]
        spread = (h * Sh).sum(axis=1) + _NOISE**2
        parts = parts + Sh * ((disturbance - (h * parts).sum(axis=1)) / spread)[:, None]
        S = S - Sh[:, :, None] * Sh[:, None, :] / spread[:, None, None]
        return np.concatenate([parts.ravel(), S.ravel()])

    def ahead(self, memory: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """The disturbance in rad/s^2 at planned speeds in rad/s, (n, 6) each."""
        return (self._shapes(speed) * self._split(memory)[0]).sum(axis=-1)

    def slope(self, speed: np.ndarray) -> np.ndarray:
        """By how much believed friction grows with the speed, in 1/s, at speeds in rad/s, (n, 6) each."""
        return self._viscous + self._coulomb / self._width * (1.0 - np.tanh(speed / self._width) ** 2)

    def _shapes(self, speed: np.ndarray) -> np.ndarray:
        return np.stack([np.tanh(speed / self._width), speed, np.ones_like(speed)], axis=-1)

    @staticmethod
    def _split(memory: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        own = NUM_JOINTS * PARTS
        return memory[:own].reshape(NUM_JOINTS, PARTS), memory[own:].reshape(NUM_JOINTS, PARTS, PARTS)

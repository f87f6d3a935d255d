"""A small motion before the path begins, while nothing depends on where the tip is: it shows the robot."""

from dataclasses import dataclass, field

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel

_MARGIN = 0.8  # of the way to a limit
_SPEED_SHARE = 0.3
_KNOCK_SHARE, _KNOCK_BEGIN, _KNOCK_LENGTH = 0.2, 0.15, 0.4  # of the amplitude; s
_PERIODS = np.array([1, 1, 2, 2, 3, 3])  # of the six axes in the window: none moves as another does
_PHASES = np.array([0, 1, 0, 1, 0, 1]) * 0.5 * np.pi


@dataclass
class ProbeConfig:
    """Whether and how far the joints move before the path begins."""

    kind: str = "smooth"  # or none
    amplitude: list[float] = field(default_factory=lambda: [0.05, 0.05, 0.05, 0.15, 0.15, 0.15])  # rad
    largest_excursion: float = 0.15  # m, of the tip
    begin: float = 0.8  # s after the start
    rest: float = 0.3  # s before the path begins


class Probe:
    """A short knock that shows the dead time, then oscillations of all joints under a sin^2 window.

    Both begin and end at rest; times count from the start.
    """

    def __init__(self, robot: RobotModel, config: ProbeConfig) -> None:
        """Checks the configuration.

        Raises:
            ValueError: if the kind is unknown, or amplitudes are negative or not six.
        """
        if config.kind not in ("smooth", "none"):
            raise ValueError(f"probe: kind must be smooth or none, got '{config.kind}'")
        amplitude = np.array(config.amplitude, dtype=float)
        if amplitude.shape != (NUM_JOINTS,) or not (amplitude >= 0.0).all():
            raise ValueError(
                f"probe: amplitude must be six numbers of at least 0 rad, got {config.amplitude}"
            )
        self._config, self._amplitude = config, amplitude
        self._lower, self._upper, self._speed = robot.lower, robot.upper, robot.speed

    def window(self, path_start: float) -> tuple[float, float]:
        """Begin and length in s; a length of zero if there is no time for it or it is not wanted."""
        length = path_start - self._config.rest - self._config.begin
        return self._config.begin, length if self._config.kind == "smooth" and length > 0.5 else 0.0

    def amplitude(self, q: np.ndarray, J: np.ndarray, path_start: float) -> np.ndarray:
        """Amplitudes in rad that keep to the limits of joints, speeds and the tip's excursion.

        Args:
            q: where the robot starts, rad, (6,).
            J: Jacobian of the tip there, (6, 6).
            path_start: s.
        """
        _, length = self.window(path_start)
        if length == 0.0:
            return np.zeros(NUM_JOINTS)
        room = _MARGIN * np.maximum(0.0, np.minimum(self._upper - q, q - self._lower))
        fastest = _SPEED_SHARE * self._speed * length / (2.0 * np.pi * (_PERIODS + 0.5))
        size = np.minimum(np.minimum(self._amplitude, room), fastest)
        excursion = float(np.linalg.norm(J[3:], axis=0) @ size)
        return size * min(1.0, self._config.largest_excursion / max(excursion, 1e-9))

    def at(
        self, time: float, path_start: float, amplitude: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Displacement of the joints and its two derivatives at a time in s, (6,) each."""
        begin, length = self.window(path_start)
        if 0.0 < time - _KNOCK_BEGIN < _KNOCK_LENGTH:
            # sin^4: a step of the acceleration would be a step of the gears' deflection.
            s, w = 2.0 * np.pi * (time - _KNOCK_BEGIN) / _KNOCK_LENGTH, 2.0 * np.pi / _KNOCK_LENGTH
            u, du, ddu = 0.5 - 0.5 * np.cos(s), 0.5 * w * np.sin(s), 0.5 * w * w * np.cos(s)
            size = _KNOCK_SHARE * amplitude
            return size * u * u, 2.0 * size * u * du, 2.0 * size * (du * du + u * ddu)
        if not 0.0 < time - begin < length:
            return np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS)
        s, w = (time - begin) / length, 2.0 * np.pi / length
        window = 0.5 - 0.5 * np.cos(2.0 * np.pi * s)
        slope, bend = 0.5 * w * np.sin(2.0 * np.pi * s), 0.5 * w * w * np.cos(2.0 * np.pi * s)
        f = w * _PERIODS
        sine, cosine = np.sin(f * (time - begin) + _PHASES), np.cos(f * (time - begin) + _PHASES)
        return (
            amplitude * window * sine,
            amplitude * (slope * sine + window * f * cosine),
            amplitude * (bend * sine + 2.0 * slope * f * cosine - window * f * f * sine),
        )

"""A small motion before the path begins, while nothing depends on where the tip is: it shows the robot."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robots.configuration.quantity import choice, positive, quantity
from robots.description.model import NUM_JOINTS, RobotModel

_MARGIN = 0.8  # of the way to a limit
_SPEED_SHARE = 0.3
_KNOCK_BEGIN, _KNOCK_LENGTH = 0.15, 0.4  # s
_KNOCK_SIZE = np.array([0.01, 0.01, 0.01, 0.03, 0.03, 0.03])  # rad
_INSTANTS = np.linspace(0.0, 1.0, 59)  # of the window, at which limits are looked at
_NOT_YET = 0.02  # s before they begin, where oscillations wait: no tick passes over that
_MOSTLY = 0.8  # of the window, after which oscillations are small and those that were are seen
_SHORTEST = 0.5  # s, a window in which it is worth while to move
_AMPLITUDE = np.array([0.19, 0.19, 0.19, 0.5, 0.5, 0.5])  # rad
_EXCURSION = 0.125  # m
_UNEVEN = 0.8  # times as far, where gears have errors: more of them is met farther away than is learnt there
_USUAL_PERIOD, _MOST_GROWTH = 4e-3, 1.2  # s, of a camera for which both are enough; times, that both may grow


@dataclass
class ProbeConfig:
    """Whether and how far the joints move before the path begins."""

    kind: str = choice("smooth", ("smooth", "none"))
    # Amplitudes in rad, at most, and how far the tip may go in m. If none are given, 0.19 rad of the first
    # three axes, 0.5 rad of the others, and 0.125 m; up to a fifth more with a camera that looks less
    # often than every 4 ms: what samples show goes with their number and the square of the motion. A
    # fifth less where gears have errors.
    amplitude: list[float] | None = None
    largest_excursion: float | None = positive(None, "m")
    begin: float = quantity(0.8, 0.0, unit="s")  # after the start
    rest: float = quantity(0.05, 0.0, unit="s")  # before the path begins: motors that stick wind up at rest
    # For which the camera may see nothing on the path: what is needed then is shown before. Of 0.35, 0.5
    # and 0.8 s this leaves least at worst, 0.052, 0.046 and 0.057 mm (`truetip robustness --laws
    # self_calibrating --cases drop-outs --first-seed 5001 --seeds 3`).
    blind: float = quantity(0.5, 0.0, unit="s")
    # A tip that will be known so well all along the path needs no oscillations
    sharp: float = quantity(3e-5, 0.0, unit="m")
    # Standard deviation: where a camera that shows little, as it is slow or noisy, leaves the tip at the
    # begin of the path known less well than this, the oscillations are repeated and the path waits for them,
    # at most so often.
    enough: float = positive(6e-5, "m")
    repeats: int = quantity(3, 0)
    vague: float = positive(2.5e-4, "m")  # a tip that is known less well than this on the path is an event


class Pattern(NamedTuple):
    """Oscillations of the joints under one window, sin^3(pi t / length)."""

    size: np.ndarray  # (6,) rad
    periods: np.ndarray  # (6,), in the window
    phases: np.ndarray  # (6,) rad

    def at(self, times: np.ndarray, length: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Displacement and its two derivatives at times in s since the window began, (n, 6) each."""
        w, times = 2.0 * np.pi / length, times[:, None]
        # Its first two derivatives vanish at both ends: a step of the acceleration would be one of the
        # deflection of the gears.
        s, c = np.sin(0.5 * w * times), np.cos(0.5 * w * times)
        window, slope, bend = s**3, 1.5 * w * s * s * c, 0.75 * w * w * s * (2.0 * c * c - s * s)
        f = w * self.periods
        sine, cosine = np.sin(f * times + self.phases), np.cos(f * times + self.phases)
        return (
            self.size * window * sine,
            self.size * (slope * sine + window * f * cosine),
            self.size * (bend * sine + 2.0 * slope * f * cosine - window * f * f * sine),
        )


# None of the axes moves as another does.
USUAL = Pattern(np.ones(NUM_JOINTS), np.array([1, 1, 2, 2, 3, 3]), np.array([0, 1, 0, 1, 0, 1]) * 0.5 * np.pi)


class Probe:
    """A short knock that shows the dead time, then oscillations of all joints under a smooth window.

    Both begin and end at rest; times count from the start. Which axis oscillates how often, and how far, is
    for who knows the path to say: `pattern` is the usual one, as large as it may be, until it is replaced.
    """

    def __init__(
        self,
        robot: RobotModel,
        config: ProbeConfig,
        camera_period: float = _USUAL_PERIOD,
        has_gear_errors: bool = False,
    ) -> None:
        """Checks the configuration.

        Args:
            robot: whose limits hold.
            config: of the motion.
            camera_period: s, between two samples.
            has_gear_errors: whether gears are believed to have more than springs.

        Raises:
            ValueError: if the kind is unknown, amplitudes are negative or not six, or the camera is blind for
                a negative time.
        """
        if config.kind not in ("smooth", "none"):
            raise ValueError(f"probe: kind must be smooth or none, got '{config.kind}'")
        growth = min(max(1.0, math.sqrt(camera_period / _USUAL_PERIOD)), _MOST_GROWTH)
        growth *= _UNEVEN if has_gear_errors else 1.0
        given, excursion = config.amplitude, config.largest_excursion
        amplitude = growth * _AMPLITUDE if given is None else np.array(given, dtype=float)
        self._excursion = growth * _EXCURSION if excursion is None else excursion
        if amplitude.shape != (NUM_JOINTS,) or not (amplitude >= 0.0).all():
            raise ValueError(
                f"probe: amplitude must be six numbers of at least 0 rad, got {config.amplitude}"
            )
        if not 0.0 <= config.blind < np.inf:
            raise ValueError(f"probe: blind must be a time of at least 0 s, got {config.blind}")
        self._config, self._amplitude = config, amplitude
        self._lower, self._upper, self._speed = robot.lower, robot.upper, robot.speed
        self.pattern = USUAL._replace(size=amplitude)

    def window(self, path_start: float) -> tuple[float, float]:
        """Begin and length in s; a length of zero if there is no time for it or it is not wanted."""
        length = path_start - self._config.rest - self._config.begin
        is_wanted = self._config.kind == "smooth" and length > _SHORTEST
        return self._config.begin, length if is_wanted else 0.0

    def amplitude(self, q: np.ndarray, J: np.ndarray, path_start: float) -> np.ndarray:
        """Amplitudes in rad of knock and oscillations, (2, 6), within the limits of joints, speeds and tip.

        Args:
            q: where the robot starts, rad, (6,).
            J: Jacobian of the tip there, (6, 6).
            path_start: s.
        """
        _, length = self.window(path_start)
        if length == 0.0:
            return np.zeros((2, NUM_JOINTS))
        room = self.room(q)
        size = self.within_limits(self.pattern, room, J, length)
        knock = np.minimum(np.minimum(_KNOCK_SIZE, self._amplitude), room)
        knock_way = float(np.linalg.norm(J[3:] @ knock))
        return np.array([knock * min(1.0, self._excursion / max(knock_way, 1e-9)), size])

    def within_limits(self, pattern: Pattern, room: np.ndarray, J: np.ndarray, length: float) -> np.ndarray:
        """The amplitudes of a pattern in rad, made smaller by what it would go beyond limits, (6,).

        Args:
            pattern: of the oscillations.
            room: how far each joint may go, rad, (6,).
            J: Jacobian of the tip, (6, 6).
            length: of the window in s.
        """
        pattern = pattern._replace(size=np.minimum(np.minimum(pattern.size, self._amplitude), room))
        displacement, velocity, _ = pattern.at(length * _INSTANTS, length)
        excursion = float(np.linalg.norm(displacement @ J[3:].T, axis=1).max())
        haste = float((np.abs(velocity).max(axis=0) / (_SPEED_SHARE * self._speed)).max())
        largest = max(1.0, excursion / self._excursion, haste)
        return pattern.size / largest

    def room(self, q: np.ndarray) -> np.ndarray:
        """How far the joints may go from q (rad, (6,)) without coming near their limits, rad, (6,)."""
        return _MARGIN * np.maximum(0.0, np.minimum(self._upper - q, q - self._lower))

    def waited(self, time: float, waited: float) -> float:
        """How long oscillations that may not begin yet have waited at a time in s; once begun they go on."""
        until = self._config.begin - _NOT_YET
        return max(waited, time - until) if time - waited <= self._config.begin else waited

    def shown(self, path_start: float) -> float:
        """When most of the oscillations is over if they do not wait, s."""
        begin, length = self.window(path_start)
        return begin + _MOSTLY * length

    def is_over(self, time: float, path_start: float) -> bool:
        """Whether oscillations are, at a time in s that they have not waited."""
        return time >= sum(self.window(path_start))

    def at(self, time: float, path_start: float, amplitude: np.ndarray, waited: float = 0.0) -> np.ndarray:
        """Displacement of the joints in rad and its two derivatives at a time in s, (3, 6).

        Oscillations come later by what they have waited, in s; the path has to be held for as long.
        """
        begin, length = self.window(path_start)
        motion = np.zeros((3, NUM_JOINTS))
        if 0.0 < time - _KNOCK_BEGIN < _KNOCK_LENGTH:
            # sin^4: a step of the acceleration would be a step of the gears' deflection.
            s, w = 2.0 * np.pi * (time - _KNOCK_BEGIN) / _KNOCK_LENGTH, 2.0 * np.pi / _KNOCK_LENGTH
            u, du, ddu = 0.5 - 0.5 * np.cos(s), 0.5 * w * np.sin(s), 0.5 * w * w * np.cos(s)
            motion += np.outer((u * u, 2.0 * u * du, 2.0 * (du * du + u * ddu)), amplitude[0])
        time -= waited
        if 0.0 < time - begin < length:  # begun early they go on beside the knock
            pattern = self.pattern._replace(size=amplitude[1])
            motion += np.concatenate(pattern.at(np.array([time - begin]), length))
        return motion

"""Recorded motions as they come from the robot and from a logger with a clock of its own."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from robots.identification.motion import MotionCase, SensorPlace
from robots.metrology.time_alignment import AlignmentError, align

WINDOW = 0.25  # s, by which clocks may be apart
_AXES = "xyz"
_CLEAR = 0.3  # by which another order of axes has to fit better than the one that was given
_ALIKE = 0.7  # correlation of a sensor with what motors make of it, above which their sizes are compared
_LARGER = 5.0  # times as large as it should be, or as small: another unit
_BEYOND = 2.0 * np.pi  # rad, beyond the range of a joint: another unit
_EXCITED = 3.0  # times the noise, what a channel has to show to be compared


class RecordingError(ValueError):
    """A recording from which nothing can be learnt; the message says why."""


@dataclass(frozen=True)
class RecordedCase:
    """One motion as it was recorded; n samples of the robot, m of the logger."""

    name: str
    time: np.ndarray  # (n,) s, by the robot's clock, evenly
    theta: np.ndarray  # (n, 6) rad, motors on the side of the links
    rate: np.ndarray  # (n, 6) rad/s
    torque: np.ndarray  # (n, 6) N m on the side of the links, or (0, 6) where it is not known
    stamps: np.ndarray  # (m,) s, by the logger's clock
    readings: np.ndarray  # (m, sensors, 3) rad/s or m/s^2
    # (n, 3, 6) rad, rad/s, N m: what the drives were told last; None where it is not known
    commands: np.ndarray | None = None
    payload: float | None = None  # kg at the flange, where it is another one than that of the other motions

    @property
    def period(self) -> float:
        """Between samples of the robot in s."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))

    def at_lag(self, lag: float) -> MotionCase:
        """On the robot's time axis, if stamps are ahead by a lag in s; NaN where no sample was taken."""
        times = self.time + lag
        flat = self.readings.reshape(len(self.stamps), -1)
        shown = CubicSpline(self.stamps, flat, extrapolate=False)(times)
        return MotionCase(self.name, self.period, self.theta, self.rate, shown.reshape(len(times), -1, 3))


def lag_of(case: RecordedCase, modelled: np.ndarray, sensors: Sequence[SensorPlace], before: float) -> float:
    """By how much the logger's stamps are ahead in s: where its gyros fit modelled readings best.

    Args:
        case: with its stamps.
        modelled: what the sensors should show, shape (n, sensors, 3), NaN where that is not known.
        sensors: of the logger.
        before: about what the lag is, in s.

    Raises:
        RecordingError: if there is no such lag within the window.
    """
    gyros = [i for i, sensor in enumerate(sensors) if sensor.kind == "gyro"] or list(range(len(sensors)))
    scale = np.array([sensors[i].sigma or 1.0 for i in gyros])[:, None]
    shown = case.at_lag(before).readings[:, gyros] / scale
    known = np.asarray(np.isfinite(shown).all((1, 2)) & np.isfinite(modelled).all((1, 2)))
    if known.sum() < len(known) // 2:
        raise RecordingError(
            f"case {case.name}: the stamps of robot and sensors have less than half of the time in common: "
            f"{case.time[0]:g} to {case.time[-1]:g} s and {case.stamps[0]:g} to {case.stamps[-1]:g} s"
        )
    first, second = (each[known].reshape(known.sum(), -1) for each in (modelled[:, gyros] / scale, shown))
    try:
        return before + align(first, second, case.period, WINDOW).lag
    except AlignmentError as error:
        raise RecordingError(f"case {case.name}: the clocks of robot and sensors: {error}") from error


def check_excitation(
    cases: Sequence[MotionCase], modelled: Sequence[np.ndarray], sensors: Sequence[SensorPlace]
) -> None:
    """Refuses recordings in which nothing moves.

    Raises:
        RecordingError: if no sensor should show more than its noise.
    """
    largest = max(float(np.abs(case.rate).max()) for case in cases)
    shown = [_spread(modelled, i) / max(sensor.sigma, 1e-12) for i, sensor in enumerate(sensors)]
    if max(float(each.max()) for each in shown) < _EXCITED:
        raise RecordingError(
            f"the recording has no excitation: no motor is faster than {np.rad2deg(largest):.2g} deg/s, so "
            "that no sensor shows more than noise; stiffness and damping of gears, bearings and beams cannot "
            "be seen"
        )


def check_range(cases: Sequence[RecordedCase], lower: np.ndarray, upper: np.ndarray) -> None:
    """Refuses positions that no joint can have, such as degrees.

    Args:
        cases: the motions.
        lower: limits of the joints in rad, (6,).
        upper: likewise.

    Raises:
        RecordingError: if a joint is more than a turn beyond its range; names it.
    """
    for case in cases:
        beyond = np.maximum(lower - case.theta, case.theta - upper)
        row, joint = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
        if beyond[row, joint] > _BEYOND:
            least, most, at = np.rad2deg([lower[joint], upper[joint], case.theta[row, joint]])
            raise RecordingError(
                f"case {case.name}: joint {joint + 1} is at {at:.4g} degrees, "
                f"its range is {least:g} to {most:g}; are positions in degrees? angle_factor says so"
            )


def check_sizes(
    cases: Sequence[MotionCase], modelled: Sequence[np.ndarray], sensors: Sequence[SensorPlace]
) -> None:
    """Refuses sensors whose readings are many times as large or small as the motors make them.

    Raises:
        RecordingError: if one resembles what it should show, but in another unit; names it.
    """
    for i, sensor in enumerate(sensors):
        should, shown = _without_means(cases, modelled, i)
        if not (should.std(0) > _EXCITED * sensor.sigma).any():
            continue
        product, square = float((should * shown).sum()), float((should**2).sum())
        correlation = product / np.sqrt(square * max(float((shown**2).sum()), np.finfo(float).tiny))
        size = product / square
        if correlation > _ALIKE and not 1.0 / _LARGER < size < _LARGER:
            unit = "rad/s" if sensor.kind == "gyro" else "m/s^2"
            raise RecordingError(
                f"{sensor.kind} '{sensor.name}': it shows {size:.3g} times what the motors make of it; "
                f"in which unit are its columns? factor brings them to {unit}"
            )


def _without_means(
    cases: Sequence[MotionCase], modelled: Sequence[np.ndarray], sensor: int
) -> tuple[np.ndarray, np.ndarray]:
    """What a sensor should show and what it does, where both are known, (n, 3) each."""
    should = np.concatenate([each[:, sensor] for each in modelled])
    shown = np.concatenate([case.readings[:, sensor] for case in cases])
    known = np.isfinite(shown).all(1) & np.isfinite(should).all(1)
    return should[known] - should[known].mean(0), shown[known] - shown[known].mean(0)


def check_axes(
    cases: Sequence[MotionCase], modelled: Sequence[np.ndarray], sensors: Sequence[SensorPlace]
) -> None:
    """Refuses gyros whose axes are swapped or turned round, found by correlation with what they should show.

    Raises:
        RecordingError: if another order or sign of the axes of a gyro fits clearly better; names it.
    """
    for i, sensor in enumerate(sensors):
        if sensor.kind != "gyro":
            continue
        should, shown = _without_means(cases, modelled, i)
        loud = should.std(0) > _EXCITED * sensor.sigma
        norms = np.outer(np.linalg.norm(should, axis=0), np.linalg.norm(shown, axis=0))
        fits = should.T @ shown / np.where(norms > 0.0, norms, 1.0)
        for axis in np.flatnonzero(loud):
            best = int(np.argmax(np.abs(fits[axis])))
            if np.abs(fits[axis, best]) > fits[axis, axis] + _CLEAR:
                sign = "-" if fits[axis, best] < 0.0 else ""
                raise RecordingError(
                    f"gyro '{sensor.name}': its axes are swapped or turned round: what should be "
                    f"{_AXES[axis]} is on {sign}{_AXES[best]} (correlation {abs(fits[axis, best]):.2f} "
                    f"against {fits[axis, axis]:.2f}); correct its columns or zyx_deg"
                )


def _spread(modelled: Sequence[np.ndarray], sensor: int) -> np.ndarray:
    """How far the readings of a sensor move at most within a case, (3,)."""
    return np.max([np.ptp(each[:, sensor], axis=0) for each in modelled], axis=0)

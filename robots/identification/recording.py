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
_SAME = 1.2  # the most by which sizes of gyros may differ where all of them seem to be in another unit
_UPRIGHT = 0.95  # correlation with gravity, above which an accelerometer is taken to show it
_NOTHING = 1e-9  # of what a sensor should show: rounding
_OFFSET = 0.05  # of gravity: what a sensor without it may be off by at rest


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
        raise RecordingError(
            f"case {case.name}: the clocks of robot and sensors: {error}; if they are closer, some joint's "
            "column is another one's or has the other sign"
        ) from error


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


def check_speeds(cases: Sequence[RecordedCase]) -> None:
    """Refuses speeds that are not those of the positions: another unit or sign of one of them or of the time.

    Raises:
        RecordingError: that names case and joint.
    """
    for case in cases:
        derived = CubicSpline(case.time, case.theta).derivative()(case.time)
        joint = int(np.argmax(np.abs(derived).max(0) * np.abs(case.rate).max(0)))
        size, correlation = _size(derived[:, joint], case.rate[:, joint])
        if abs(correlation) > _ALIKE and not 1.0 / _LARGER < size < _LARGER:
            raise RecordingError(
                f"case {case.name}: the speed of joint {joint + 1} is {size:.3g} times what its positions "
                "and the time make of it; angle_factor is for positions and speeds alike, the time is in s"
            )


def check_sizes(
    cases: Sequence[MotionCase], modelled: Sequence[np.ndarray], sensors: Sequence[SensorPlace]
) -> None:
    """Refuses sensors that show nothing, or many times as much or little as the motors make of them.

    Raises:
        RecordingError: if one resembles what it should show, but in another unit, or is dead; names it.
    """
    off: dict[str, float] = {}  # sizes of sensors by their names, as they are told
    gyros: list[float] = []
    for i, sensor in enumerate(sensors):
        should, shown = _without_means(cases, modelled, i)
        if not (should.std(0) > _EXCITED * sensor.sigma).any():
            continue
        changes = max(float(np.ptp(_shown(case, i), axis=0).max()) for case in cases)
        if changes <= _NOTHING * float(np.abs(should).max()):
            raise RecordingError(f"{_named(sensor)}: it shows nothing but one value; is its factor 0?")
        size, correlation = _size(should, shown)
        # Axes that are swapped do not make a sensor less of one kind.
        overall = float(np.sqrt(np.square(shown).sum() / np.square(should).sum()))
        gyros += [overall] if sensor.kind == "gyro" else []
        if correlation > _ALIKE and not 1.0 / _LARGER < size < _LARGER:
            off[sensor.name] = size
    if len(gyros) > 1 and max(gyros) < _SAME * min(gyros) and not 1.0 / _LARGER < gyros[0] < _LARGER:
        raise RecordingError(
            f"all gyros show some {np.median(gyros):.2g} times what the motors make of them: positions and "
            "speeds are in another unit than angle_factor says, or the gyros than their factor says"
        )
    for sensor in sensors:
        if sensor.name in off:
            raise _other_unit(sensor, off[sensor.name], "the motors make of it")


def check_gravity(
    cases: Sequence[MotionCase], modelled: Sequence[np.ndarray], sensors: Sequence[SensorPlace]
) -> None:
    """Refuses accelerometers that show gravity in another unit, whatever else they show.

    Args:
        cases: with readings from which nothing was taken.
        modelled: what sensors should show, (n, sensors, 3) each.
        sensors: in the order of the readings.

    Raises:
        RecordingError: that names the sensor.
    """
    for i, sensor in enumerate(sensors):
        if sensor.kind != "accelerometer":
            continue
        # Means of the motions, which are free of ringing. One that shows changes alone is off by some offset.
        both = [_both([case], [each], i) for case, each in zip(cases, modelled, strict=True)]
        means = [(should.mean(0), shown.mean(0)) for should, shown in both if len(shown)]
        if not means:  # the clocks have nothing in common
            continue
        size, correlation = _size(*np.moveaxis(np.array(means), 1, 0))
        if correlation > _UPRIGHT and (_OFFSET < size < 1.0 / _LARGER or size > _LARGER):
            raise _other_unit(sensor, size, "gravity makes of it")


def _size(should: np.ndarray, shown: np.ndarray) -> tuple[float, float]:
    """How many times as large something is as it should be, and the correlation of the two."""
    wanted, got = (max(float(np.linalg.norm(each)), np.finfo(float).tiny) for each in (should, shown))
    cosine = float((should / wanted * (shown / got)).sum())
    return cosine * got / wanted, cosine


def _named(sensor: SensorPlace) -> str:
    return f"{sensor.kind} '{sensor.name}'"


def _other_unit(sensor: SensorPlace, size: float, against: str) -> RecordingError:
    unit = "rad/s" if sensor.kind == "gyro" else "m/s^2"
    return RecordingError(
        f"{_named(sensor)}: it shows {size:.3g} times what {against}; "
        f"in which unit are its columns? factor brings them to {unit}"
    )


def _without_means(
    cases: Sequence[MotionCase], modelled: Sequence[np.ndarray], sensor: int
) -> tuple[np.ndarray, np.ndarray]:
    """What a sensor should show and what it does beyond their means, where both are known, (n, 3) each."""
    should, shown = _both(cases, modelled, sensor)
    return should - should.mean(0), shown - shown.mean(0)


def _both(
    cases: Sequence[MotionCase], modelled: Sequence[np.ndarray], sensor: int
) -> tuple[np.ndarray, np.ndarray]:
    """What a sensor should show and what it does, where both are known, (n, 3) each."""
    should = np.concatenate([each[:, sensor] for each in modelled])
    shown = np.concatenate([case.readings[:, sensor] for case in cases])
    known = np.isfinite(shown).all(1) & np.isfinite(should).all(1)
    return should[known], shown[known]


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


def _shown(case: MotionCase, sensor: int) -> np.ndarray:
    """Readings of a sensor where it was read, (n, 3)."""
    shown = case.readings[:, sensor]
    return shown[np.isfinite(shown).all(1)]


def _spread(modelled: Sequence[np.ndarray], sensor: int) -> np.ndarray:
    """How far the readings of a sensor move at most within a case, (3,)."""
    return np.max([np.ptp(each[:, sensor], axis=0) for each in modelled], axis=0)

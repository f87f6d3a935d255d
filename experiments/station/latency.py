"""Delays from recorded motions: the time shift at which one motion matches the other."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.signal import correlate, correlation_lags

from diagrams.runs.latency import LatencyRecord

_LONGEST = 0.5  # s, of a delay that is looked for
_TRIM = 0.6  # s at both ends, where the shifted motion is not known
_SURE = 3.0  # standard errors


class ImpossibleDelayError(ValueError):
    """A measurement whose result cannot be."""


@dataclass(frozen=True)
class Latency:
    """The delays of a station in s."""

    cycle: float  # between two messages of the controller
    loop: float  # from a command to the joint at it, as the controller's stamps have it
    dead_time: float  # of that, what is more than the one cycle in which a reply is heard
    loop_sigma: float  # standard error, of the dead time too
    residual: float  # rad, root mean square of what is left of the motion
    camera: float | None  # from exposure to arrival
    camera_sigma: float | None
    camera_residual: float | None  # m
    drift_ppm: float | None  # the camera's clock gains this on the controller's
    drift_sigma_ppm: float | None
    jitter: dict[str, dict[str, float]]  # s, of messages and frames above the smallest delay
    turn_around: dict[str, float]  # s, our own, from a message in to its reply out

    def as_dict(self) -> dict[str, Any]:
        """For a JSON text, in ms."""

        def ms(value: float | None) -> float | None:
            return None if value is None else 1e3 * value

        return {
            "cycle_ms": ms(self.cycle),
            "loop_ms": ms(self.loop),
            "dead_time_ms": ms(self.dead_time),
            "loop_sigma_ms": ms(self.loop_sigma),
            "camera_ms": ms(self.camera),
            "camera_sigma_ms": ms(self.camera_sigma),
            "drift_ppm": self.drift_ppm,
            "drift_sigma_ppm": self.drift_sigma_ppm,
            "jitter_ms": {
                name: {level: ms(value) for level, value in levels.items()}
                for name, levels in self.jitter.items()
            },
            "turn_around_ms": {level: ms(value) for level, value in self.turn_around.items()},
            "residual_rad": self.residual,
            "camera_residual_mm": ms(self.camera_residual),
        }


def evaluate(record: LatencyRecord) -> Latency:
    """Finds the delays.

    Raises:
        ImpossibleDelayError: if nothing moved, the motions do not resemble each other, or what comes out
            cannot be.
    """
    cycle = float(np.median(np.diff(record.stamp)))
    loop, residual, loop_sigma = delay_between(
        record.stamp, record.commanded, record.stamp, record.measured[:, None], 1
    )
    spread = float(record.commanded.std())
    if residual > 0.1 * spread:
        raise ImpossibleDelayError(
            f"the joint does not follow: {residual:.1e} rad are left of a motion of {spread:.1e} rad"
        )
    # Where in a cycle a controller takes its set-point and reads its joints is not known.
    within_cycle = cycle / math.sqrt(12.0)
    camera = camera_residual = camera_sigma = drift = drift_sigma = None
    jitter = {"controller": record.robot_clock.jitter}
    if record.camera_clock is not None and len(record.seen) > 10:
        # A tool on a circle: its coordinates are polynomials of the joint's angle.
        camera, camera_residual, camera_sigma = delay_between(
            record.reported, record.measured, record.seen, record.position, 3
        )
        camera_sigma = math.hypot(camera_sigma, within_cycle)
        # Both drifts are those of our clock against theirs.
        drift = record.robot_clock.drift_ppm - record.camera_clock.drift_ppm
        drift_sigma = float(np.hypot(record.camera_clock.drift_sigma_ppm, record.robot_clock.drift_sigma_ppm))
        jitter["camera"] = record.camera_clock.jitter
    levels = dict(zip(("50%", "99%", "100%"), np.percentile(record.turn_around, [50, 99, 100]), strict=True))
    found = Latency(
        cycle,
        loop,
        loop - cycle,
        math.hypot(loop_sigma, within_cycle),
        residual,
        camera,
        camera_sigma,
        camera_residual,
        _finite(drift),
        _finite(drift_sigma),
        jitter,
        {level: float(value) for level, value in levels.items()},
    )
    _refuse_impossible(found)
    return found


def _refuse_impossible(found: Latency) -> None:
    """Raises ImpossibleDelayError for delays that no station has."""
    delays = [
        ("the loop takes", found.loop, found.loop_sigma),
        ("the dead time is", found.dead_time, found.loop_sigma),
    ]
    if found.camera is not None:
        assert found.camera_sigma is not None
        delays.append(("the camera's delay is", found.camera, found.camera_sigma))
    for what, delay, sigma in delays:
        if delay < -_SURE * sigma:
            raise ImpossibleDelayError(
                f"the measurement failed: {what} {1e3 * delay:.2f} ms +- {1e3 * sigma:.2f} ms, an effect "
                "before its cause"
            )
    for line, delay in (("controller", found.loop), ("camera", found.camera)):
        jitter = found.jitter.get(line, {}).get("50%", math.nan)
        # Clocks are related by the quickest messages: half of the others are late by more than there is.
        if delay is not None and jitter > max(delay, found.cycle):
            raise ImpossibleDelayError(
                f"the measurement failed: half of the messages of the {line} come {1e3 * jitter:.1f} ms "
                f"later than the quickest, but its whole delay would be {1e3 * delay:.1f} ms: is this "
                "machine busy with other work?"
            )


def delay_between(
    cause_time: np.ndarray, cause: np.ndarray, effect_time: np.ndarray, effect: np.ndarray, degree: int
) -> tuple[float, float, float]:
    """The delay after which an effect follows its cause, and what it does not explain.

    The effect is a polynomial of the delayed cause, with coefficients that are found too: their scale does
    not matter. The peak of the cross-correlation is the beginning, least squares find the rest.

    Args:
        cause_time: s, shape (n,).
        cause: shape (n,).
        effect_time: s, shape (m,), of the same clock.
        effect: shape (m, k).
        degree: of the polynomial.

    Returns:
        Delay in s, negative if the effect comes first, the root mean square of the rest, and the standard
        error of the delay, for which the rest counts as its correlation in time leaves it.
    """
    spline = CubicSpline(cause_time, cause)
    inside = (effect_time > cause_time[0] + _TRIM) & (effect_time < cause_time[-1] - _TRIM)
    time, values = effect_time[inside], effect[inside] - effect[inside].mean(axis=0)

    def fitted(delay: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Powers of the delayed cause (m, degree + 1), what is left (m, k), and its slope over the delay."""
        moved, scale = spline(time - delay), spline(time).std() or 1.0
        powers = np.arange(degree + 1)
        scaled = (moved - moved.mean()) / scale
        A = scaled[:, None] ** powers
        solution = np.linalg.lstsq(A, values, rcond=None)[0]
        slope = (powers[1:] * scaled[:, None] ** powers[:-1]) @ solution[1:]
        return A, values - A @ solution, slope * (spline(time - delay, 1) / scale)[:, None]

    def rest(delay: float) -> float:
        return float(np.sqrt(np.mean(fitted(delay)[1] ** 2)))

    first = _correlation_peak(spline, time, values)
    found: Any = minimize_scalar(
        rest, bounds=(first - 0.05, first + 0.05), method="bounded", options={"xatol": 1e-7}
    )
    A, left, slope = fitted(float(found.x))
    # What of the slope no coefficient can stand for.
    seen = slope - A @ np.linalg.lstsq(A, slope, rcond=None)[0]
    information = float((seen**2).sum() / max((left**2).mean(), 1e-300)) / _memory_of(left)
    return float(found.x), float(found.fun), 1.0 / math.sqrt(max(information, 1e-300))


def _memory_of(left: np.ndarray) -> float:
    """How many successive rows (n, k) stand for one independent one, from the correlation of neighbours."""
    square = float((left[:-1] ** 2).sum()) or 1.0
    rho = float(np.clip((left[1:] * left[:-1]).sum() / square, 0.0, 0.999))
    return (1.0 + rho) / (1.0 - rho)


def _correlation_peak(spline: CubicSpline, time: np.ndarray, values: np.ndarray) -> float:
    """The delay at which the effect's strongest coordinate resembles the cause most, to a millisecond."""
    step = 1e-3
    grid = np.arange(time[0], time[-1], step)
    strongest = values[:, int(np.argmax(values.std(axis=0)))]
    effect = np.interp(grid, time, strongest)
    cause = spline(grid)
    similarity = np.abs(correlate(effect - effect.mean(), cause - cause.mean(), mode="full"))
    lags = step * correlation_lags(len(grid), len(grid), mode="full")
    near = np.abs(lags) <= _LONGEST
    return float(lags[near][np.argmax(similarity[near])])


def _finite(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)

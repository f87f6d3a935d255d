"""Figures of the error: along and across the path, over its length, over frequency, how often how large."""

import numpy as np

from diagrams.record.log import RunLog
from experiments.metrics.error_shapes import camera_errors, error_spectrum, path_errors
from experiments.metrics.run_metrics import FIRST_TICKS, Comparison
from experiments.report.panels import Axes, Panel

BINS_PER_DECADE = 12
LOWEST_MM = 1e-4  # smaller errors count as this one
Curves = list[tuple[np.ndarray, np.ndarray]]


def error_panels(logs: Comparison) -> list[Panel]:
    """The panels that there are numbers for."""
    first = {law: cycles[0] for law, cycles in logs.items()}
    panels = [
        Panel(
            "contour-and-lag",
            "Contour error and lag",
            "The error of the position, split along the tangent of the path. Lag only makes the tip late; "
            "the contour error is what a workpiece would show.",
            [
                Axes("time in s", "contour in mm", y_log=True, over_time=True),
                Axes("time in s", "lag in mm", over_time=True),
            ],
            {law: _contour_and_lag(log) for law, log in first.items()},
        ),
        Panel(
            "over-length",
            "Error over the length of the path",
            "Where on the path the tip is off, whatever the speed; peaks at corners come from accelerations.",
            [Axes("way along the path in mm", "distance in mm", y_log=True)],
            {law: _over_length(log) for law, log in first.items()},
        ),
        Panel(
            "histogram",
            "How often the error is how large",
            "Share of the samples on the path, per bin of a twelfth of a decade. The farther left and the "
            "narrower, the better.",
            [Axes("distance in mm", "share in %", x_log=True, shape="hvh")],
            {law: _histogram(log) for law, log in first.items()},
        ),
        Panel(
            "spectrum",
            "Spectrum of the error",
            "The error of the position over frequency: slow errors on the left, which a camera can correct, "
            "natural frequencies of the robot as peaks, noise of the camera as a floor.",
            [Axes("frequency in Hz", "mm / √Hz", x_log=True, y_log=True)],
            {law: _spectrum(log) for law, log in first.items()},
        ),
        Panel(
            "measured-against-true",
            "What the law knew against what was true",
            "Measured minus true pose at the time of the exposure: what the camera adds to the error that a "
            "law can see. It reaches the law late, by the delay of the camera.",
            [
                Axes("time in s", "distance in mm", over_time=True),
                Axes("time in s", "angle in °", over_time=True),
            ],
            {law: _camera(log) for law, log in first.items()},
        ),
        Panel(
            "tick-times",
            "Time that a tick of the law takes",
            "Share of the ticks that take longer than a time, on the machine that ran this. A tick that "
            "takes longer than the sampling period comes late on a real robot.",
            [Axes("time of a tick in µs", "share that takes longer in %", x_log=True, y_log=True)],
            {law: curves for law, cycles in logs.items() if (curves := _ticks(cycles[0]))},
        ),
    ]
    return [panel for panel in panels if not panel.is_empty]


def _contour_and_lag(log: RunLog) -> Curves:
    errors = path_errors(log)
    return [
        (errors.time, np.maximum(1e3 * errors.contour, LOWEST_MM)),
        (errors.time, 1e3 * errors.lag),
    ]


def _over_length(log: RunLog) -> Curves:
    errors = path_errors(log)
    return [(1e3 * errors.length, np.maximum(1e3 * errors.distance, LOWEST_MM))]


def _histogram(log: RunLog) -> Curves:
    distance = np.maximum(1e3 * path_errors(log).distance, LOWEST_MM)
    if len(distance) == 0:
        return [(np.empty(0), np.empty(0))]
    decades = np.log10(distance)
    low, high = np.floor(decades.min()), max(np.ceil(decades.max()), np.floor(decades.min()) + 1.0)
    edges = np.linspace(low, high, int((high - low) * BINS_PER_DECADE) + 1)
    counts, _ = np.histogram(decades, edges)
    middles = 0.5 * (edges[:-1] + edges[1:])
    return [(10.0**middles, 100.0 * counts / len(distance))]


def _spectrum(log: RunLog) -> Curves:
    frequency, density = error_spectrum(log)
    return [(frequency, 1e3 * density)]


def _camera(log: RunLog) -> Curves:
    time, distance, angle = camera_errors(log)
    return [(time, 1e3 * distance), (time, np.rad2deg(angle))]


def _ticks(log: RunLog) -> Curves:
    ticks = np.sort(log.tick_seconds[FIRST_TICKS:])
    longer = 100.0 * np.arange(len(ticks), 0, -1) / max(len(ticks), 1)
    return [(1e6 * ticks, longer)] if len(ticks) else []

"""The result as a figure: the distance of the true tip from its path over time, as an SVG file.

It is the only still figure, and it belongs to ``summary.json``: the same run gives the same bytes on every
machine. Written by hand it needs neither the import time of a plotting library nor its fonts.
"""

import math
from collections.abc import Mapping
from html import escape
from pathlib import Path

import numpy as np

from diagrams.record.log import RunLog
from experiments.metrics.run_metrics import known_poses
from experiments.report.files import write_text
from experiments.report.style import law_colors, law_title

WIDTH, HEIGHT = 900, 400
LEFT, RIGHT, TOP, BOTTOM = 74, 128, 56, 52  # margins of the plot
FLOOR = 1e-3  # mm, smaller distances are drawn there
SAMPLES = 900  # per law at most
LABEL_HEIGHT = 18


def write_figure(path: str | Path, title: str, logs: Mapping[str, RunLog]) -> None:
    """Draws the true distance in mm on a logarithmic scale, one line per law, atomically.

    Raises:
        OSError: if the folder is missing or cannot be written.
    """
    curves = {law: _distance_mm(log) for law, log in logs.items()}
    longest = max(logs.values(), key=lambda log: log.path_end)  # a law may let the path go on more slowly
    end = max(longest.path_end, 1e-9)
    low = math.floor(math.log10(min(float(d.min()) for _, d in curves.values())))
    high = math.ceil(math.log10(max(float(d.max()) for _, d in curves.values())))
    high = max(high, low + 1)

    def x(time: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * time / end

    def y(distance: float) -> float:
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (math.log10(distance) - low) / (high - low)

    parts = _frame(title, longest, x, y, range(low, high + 1))
    ends = {law: y(10.0 ** float(np.log10(d[-20:]).mean())) for law, (_, d) in curves.items()}
    for law, label_y in _spread(ends).items():
        color = law_colors(logs)[law]
        points = " ".join(f"{x(t):.1f},{y(d):.1f}" for t, d in zip(*curves[law], strict=True))
        parts.append(f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="1.5"/>')
        parts.append(
            f'<text x="{WIDTH - RIGHT + 8}" y="{label_y + 4:.1f}" fill="{color}" font-weight="600">'
            f"{escape(law_title(law))}</text>"
        )
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
        f'height="{HEIGHT}" font-family="system-ui, sans-serif" font-size="13" fill="#1c2430">\n'
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#ffffff"/>\n' + "\n".join(parts) + "\n</svg>\n"
    )
    write_text(path, svg)


def _distance_mm(log: RunLog) -> tuple[np.ndarray, np.ndarray]:
    """Times in s and distances of the tip in mm, both (n,), thinned out evenly."""
    keep = np.flatnonzero(log.time <= log.path_end + 1e-9)
    if len(keep) > SAMPLES:
        keep = keep[np.round(np.linspace(0, len(keep) - 1, SAMPLES)).astype(int)]
    distance = 1e3 * np.linalg.norm(log.X_WE_desired[keep, :3, 3] - known_poses(log)[keep, :3, 3], axis=1)
    return log.time[keep], np.maximum(distance, FLOOR)


def _frame(title: str, log: RunLog, x, y, decades: range) -> list[str]:
    """Title, axes, decades and the marks of the path."""
    top, bottom = y(10.0 ** decades[-1]), y(10.0 ** decades[0])
    right = x(log.path_end)
    parts = [
        f'<text x="{LEFT}" y="24" font-size="16" font-weight="600">{escape(title)}</text>',
        f'<rect x="{x(log.dwell_start):.1f}" y="{top:.1f}" width="{right - x(log.dwell_start):.1f}" '
        f'height="{bottom - top:.1f}" fill="#eef1f4"/>',
    ]
    for decade in decades:
        level = y(10.0**decade)
        parts.append(f'<path d="M{LEFT},{level:.1f}H{right:.1f}" stroke="#d8dde3"/>')
        parts.append(f'<text x="{LEFT - 8}" y="{level + 4:.1f}" text-anchor="end">{10.0**decade:g}</text>')
    step = next(s for s in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 1000) if log.path_end / s <= 12)
    for k in range(int(log.path_end / step + 1e-9) + 1):
        time = k * step
        parts.append(
            f'<text x="{x(time):.1f}" y="{bottom + 20:.1f}" text-anchor="middle">{time:g}</text>'
            f'<path d="M{x(time):.1f},{bottom:.1f}v5" stroke="#5b6673"/>'
        )
    if log.path_start > 0.0:
        parts.append(_mark(x(log.path_start), top, bottom, "path starts"))
    parts.append(_mark(x(log.dwell_start), top, bottom, "at rest"))
    parts.append(f'<path d="M{LEFT},{bottom:.1f}H{right:.1f}" stroke="#5b6673"/>')
    parts.append(
        f'<text x="{0.5 * (LEFT + right):.1f}" y="{HEIGHT - 10}" text-anchor="middle">time in s</text>'
    )
    middle = 0.5 * (top + bottom)
    parts.append(
        f'<text x="18" y="{middle:.1f}" text-anchor="middle" transform="rotate(-90 18 {middle:.1f})">'
        "distance of the true tip in mm</text>"
    )
    return parts


def _mark(x: float, top: float, bottom: float, text: str) -> str:
    return (
        f'<path d="M{x:.1f},{top:.1f}V{bottom:.1f}" stroke="#5b6673" stroke-dasharray="2 3"/>'
        f'<text x="{x + 4:.1f}" y="{top - 5:.1f}" fill="#5b6673">{text}</text>'
    )


def _spread(levels: dict[str, float]) -> dict[str, float]:
    """Moves labels apart so that none covers another; from top to bottom."""
    placed: dict[str, float] = {}
    lowest = -math.inf
    for law, level in sorted(levels.items(), key=lambda item: item[1]):
        lowest = max(level, lowest + LABEL_HEIGHT)
        placed[law] = lowest
    overhang = max(0.0, lowest - (HEIGHT - 0.5 * BOTTOM))
    return {law: level - overhang for law, level in placed.items()}

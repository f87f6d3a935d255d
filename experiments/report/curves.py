"""Curves of a page: as many points as the eye can tell apart, and numbers that pack well.

A browser adds up the differences (`curves.js`): whole numbers that are mostly small take a byte each once
they are compressed, a fifth of the same numbers as text.
"""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import plotly.graph_objects as go

MOST_POINTS = 1500  # of a curve: a plot is about 1100 pixels wide
TOLERANCE = 1.0 / 3000.0  # of the extent of a curve: a fifth of a pixel
STEPS = 20000  # into which the largest number of a curve is divided
_ROUNDS = 8
LOG_STEP = 2e-4  # of a decade, 0.05 %


def kept_points(x: np.ndarray, y: np.ndarray, most: int = MOST_POINTS) -> np.ndarray:
    """Indices of the points that one needs to draw a curve (n,) over (n,) as it is; the ends are among them.

    Of long curves the smallest and the largest value of each stretch are kept, so that no peak is lost; then
    points on a straight line between others are left out.
    """
    keep = np.arange(len(x))
    if len(x) > most:
        keep = _extremes(y, most)
    if len(keep) < 3:
        return keep
    points = np.stack([_unit(np.asarray(x)[keep]), _unit(np.asarray(y)[keep])], -1)
    return keep[_corners(points)]


def _extremes(y: np.ndarray, most: int) -> np.ndarray:
    """First, last, smallest and largest index of each of ``most`` / 4 stretches, and of its first gap."""
    edges = np.linspace(0, len(y), most // 4 + 1).astype(int)
    is_known = np.isfinite(y)
    low, high = np.where(is_known, y, np.inf), np.where(is_known, y, -np.inf)
    found: list[int] = []
    for start, end in pairwise(edges.tolist()):
        own = slice(start, end)
        found += [start + int(np.argmin(part)) for part in (low[own], -high[own], is_known[own])]
        found += [start, end - 1]
    return np.unique(found)


def _unit(values: np.ndarray) -> np.ndarray:
    finite = values[np.isfinite(values)]
    extent = float(np.ptp(finite)) if len(finite) else 0.0
    return values / extent if extent > 0.0 else np.zeros(len(values))


def _corners(points: np.ndarray) -> np.ndarray:
    """Indices of the points (n, 2) that do not lie on the line between their neighbours.

    Every second point that does is left out, again and again; each round may move the line by a part of the
    tolerance.
    """
    kept = np.arange(len(points))
    for turn in range(_ROUNDS):
        tested = np.arange(1 + turn % 2, len(kept) - 1, 2)
        if len(tested) == 0:
            break
        before, here, after = points[kept[tested - 1]], points[kept[tested]], points[kept[tested + 1]]
        chord, offset = after - before, here - before
        length = np.maximum(np.sum(chord**2, axis=1), 1e-300)
        # A point beyond the ends of the chord, as at the turn of a loop, counts from the nearer end.
        share = np.clip(np.sum(offset * chord, axis=1) / length, 0.0, 1.0)
        apart = np.linalg.norm(offset - share[:, None] * chord, axis=1)
        # Comparisons with a gap are false: it stays, and so do its neighbours.
        kept = np.delete(kept, tested[apart < TOLERANCE / _ROUNDS])
    return kept


def thinned_figure(figure: go.Figure) -> go.Figure:
    """The same figure with fewer points in its lines and numbers of six digits in its plane traces."""
    figure = go.Figure(figure)
    traces: Any = figure.data
    for trace in traces:
        if trace.type != "scatter" or trace.x is None or trace.y is None or not len(trace.y):
            continue
        x, y = np.asarray(trace.x), np.asarray(trace.y)
        if len(x) != len(y) or x.dtype.kind not in "fiu" or y.dtype.kind not in "fiu":
            continue
        if (trace.mode or "lines") == "lines" and len(y) > MOST_POINTS and trace.text is None:
            keep = kept_points(_seen(figure, trace.xaxis, "x", x), _seen(figure, trace.yaxis, "y", y))
            x, y = x[keep], y[keep]
            if trace.customdata is not None:
                trace.customdata = np.asarray(trace.customdata)[keep]
        trace.x, trace.y = rounded(x, 6), rounded(y, 6)
    return figure


def _seen(figure: go.Figure, name: str | None, letter: str, values: np.ndarray) -> np.ndarray:
    """Where numbers lie on their axis, whose name in a trace is such as ``x2``."""
    axis: Any = figure.layout[f"{letter}axis{(name or letter)[1:]}"]
    values = values.astype(float)
    return np.log10(np.where(values > 0.0, values, np.nan)) if axis.type == "log" else values


def coded(
    values: np.ndarray, is_log: bool = False, steps: int = STEPS, is_whole: bool = False
) -> dict[str, Any]:
    """Numbers (n,) as steps: ``d`` holds the first one and the differences, ``s`` the size of a step.

    Args:
        values: numbers; what is not finite, and not positive on a logarithmic scale, becomes a gap.
        is_log: whether the steps are those of the decimal logarithm.
        steps: into which the largest number is divided, if they are not.
        is_whole: whether the numbers are whole ones, whose step is one.

    Returns:
        With ``s``, ``d`` (None for a gap) and ``log``.
    """
    values = np.asarray(values, dtype=float)
    if is_log:
        values = np.log10(np.where(values > 0.0, values, np.nan))
    known = np.isfinite(values)
    step = 1.0 if is_whole else LOG_STEP
    if not (is_log or is_whole):
        largest = float(np.abs(values[known]).max()) if known.any() else 0.0
        step = float(f"{largest / steps:.3g}") or 1.0
    whole = np.round(np.where(known, values, 0.0) / step).astype(int)
    before, differences = 0, []
    for value, is_known in zip(whole.tolist(), known.tolist(), strict=True):
        differences.append(value - before if is_known else None)
        before = value if is_known else before
    return {"s": step, "d": differences, "log": is_log}


def rounded(values: np.ndarray, digits: int = 5) -> list[float | None]:
    """Numbers of so many significant digits; what is not finite becomes None."""
    return [float(f"{value:.{digits}g}") if math.isfinite(value) else None for value in values.tolist()]

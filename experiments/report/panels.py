"""Further figures of a comparison, folded until a reader opens them: what each shows and its curves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from experiments.report.curves import MOST_POINTS, coded, kept_points


@dataclass(frozen=True)
class Axes:
    """One pair of axes of a panel.

    Attributes:
        x, y: titles with units.
        heading: above the axes, such as the number of a joint; empty for none.
        x_log, y_log: whether they are logarithmic.
        limits: y values of dotted lines.
        shape: how points are joined: ``"linear"`` or ``"hvh"`` for the steps of a histogram.
        over_time: whether x is the time of the run, whose marks are then drawn.
        fits_path: whether the range of y is that of the path, whatever happened before it.
    """

    x: str
    y: str
    heading: str = ""
    x_log: bool = False
    y_log: bool = False
    limits: Sequence[float] = ()
    shape: str = "linear"
    over_time: bool = False
    fits_path: bool = False


@dataclass(frozen=True)
class Panel:
    """A figure with one curve per law in each of its axes.

    Attributes:
        id: of the element, and name of the file that its button saves.
        title: what it is.
        note: what one should see.
        axes: one or more, above each other, in two columns from four on.
        curves: law -> for each of the axes x and y of the same shape (n,); a law may be missing.
    """

    id: str
    title: str
    note: str
    axes: Sequence[Axes]
    curves: Mapping[str, Sequence[tuple[np.ndarray, np.ndarray]]] = field(default_factory=dict)

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to draw."""
        return not any(np.isfinite(y).any() for curves in self.curves.values() for _, y in curves)

    def data(self) -> dict[str, Any]:
        """What the script of the page draws, thinned out to what the eye can see."""
        most = MOST_POINTS if len(self.axes) < 4 else MOST_POINTS // 2  # of two columns each is half as wide
        return {
            "id": self.id,
            "axes": [vars(axes) | {"limits": list(axes.limits)} for axes in self.axes],
            "curves": {
                law: [
                    _curve(x, y, axes, most)
                    for (x, y), axes in zip(curves, self.axes, strict=True)
                    if len(x) > 0
                ]
                for law, curves in self.curves.items()
            },
        }


def _curve(x: np.ndarray, y: np.ndarray, axes: Axes, most: int) -> dict[str, Any]:
    seen_x = np.log10(np.maximum(x, 1e-300)) if axes.x_log else x
    seen_y = np.log10(np.where(y > 0.0, y, np.nan)) if axes.y_log else y
    keep = np.arange(len(x)) if axes.shape == "hvh" else kept_points(seen_x, seen_y, most)
    return {"x": coded(x[keep], axes.x_log), "y": coded(y[keep], axes.y_log)}

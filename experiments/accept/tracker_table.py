"""What a second instrument saw of a run, from a text table: time in s, then x, y, z of its target.

A head line is none of the numbers, and is held against them where it says an axis or a unit.
"""

import re
from pathlib import Path

import numpy as np
from scipy.ndimage import median_filter

from robots.metrology.instrument_comparison import Followed
from robots.metrology.number_table import NumberTable, read_table

UNITS = {"mm": 1e-3, "m": 1.0}
FEWEST = 100  # samples of an instrument
_AXES, _PLACES = ("", "x", "y", "z"), ("first", "second", "third", "fourth")
_BESIDE = 7  # samples, with whose median one is compared: up to three in a row may be wrong
_FASTEST = 20.0  # m/s, faster than the tool of any robot
_LEAST = 0.05  # m, by which a sample must be off to be called wrong
_MOST = 0.05  # of all samples; if more seem to be wrong, it is something else


def read_tracker(path: str | Path, unit: str) -> Followed:
    """Reads what a second instrument saw.

    Args:
        path: of the table.
        unit: of the coordinates, one of `UNITS`.

    Raises:
        ValueError: if the table is no such one, its time does not rise, its head says something else, or
            single samples are where no tool can be; names the line.
    """
    table = read_table(path, may_have_head=True)
    if table.columns != 4:
        raise table.error(f"four numbers a line are needed, time and x, y, z, there are {table.columns}")
    _check_head(table, unit)
    if len(table.values) < FEWEST:
        raise table.error(f"{len(table.values)} lines, at least {FEWEST} are needed")
    time, position = table.values[:, 0], UNITS[unit] * table.values[:, 1:]
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if len(back):
        raise table.error("the time does not rise", back[:1] + 1)
    _refuse_far(table, unit, time, position)
    return Followed(time, position)


def _check_head(table: NumberTable, unit: str) -> None:
    """Refuses a head that says another order or another unit; names that say neither are as good as none."""
    where = f"{table.name}, line {table.head_line}"
    for name, axis, place in zip(table.head, _AXES, _PLACES, strict=False):
        words = set(re.findall(r"[^\W\d_]+", name.lower()))
        if words & set(_AXES) - {axis}:
            raise ValueError(
                f"{where}: columns must be time, x, y, z in this order, the {place} is called '{name}'"
            )
        if not axis and words & {"ms", "us", "ns", "min"}:
            raise ValueError(f"{where}: the time must be in s, its column is called '{name}'")
        if axis and words & set(UNITS) - {unit}:
            raise ValueError(f"{where}: a column is called '{name}', but --unit is {unit}")


def _refuse_far(table: NumberTable, unit: str, time: np.ndarray, position: np.ndarray) -> None:
    """Refuses samples that are so far from those beside them that the tool cannot have been there."""
    beside = median_filter(position, size=(_BESIDE, 1), mode="mirror")
    steps = np.diff(time)
    if np.quantile(np.linalg.norm(np.diff(position, axis=0), axis=1) / steps, 0.9) > _FASTEST:
        return  # nearly all of it: another unit, not single lines
    reach = max(_LEAST, _FASTEST * (_BESIDE // 2) * float(np.median(steps)))
    off = np.abs(position - beside)
    far = np.flatnonzero(off.max(axis=1) > reach)
    if not 0 < len(far) <= _MOST * len(time):
        return
    row = far[0]
    axis = int(np.argmax(off[row]))
    there, usual = position[row, axis] / UNITS[unit], beside[row, axis] / UNITS[unit]
    more = f" and {len(far) - 1} more" if len(far) > 1 else ""
    raise ValueError(
        f"{table.where([row])}{more}: {_AXES[1 + axis]} is {there:.4g} {unit}, and {usual:.4g} {unit} beside "
        "it, where no tool is that fast; is its decimal point lost? Correct the line, or put # in front of it"
    )

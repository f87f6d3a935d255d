"""Rows of the error table of Probst (2024), 6.7: the same numbers in the terminal and in the report."""

from collections.abc import Mapping
from typing import Any

AXES = ("Δx mm", "Δy mm", "Δz mm", "ρx °", "ρy °", "ρz °")
KINDS = {"max": "largest", "static": "static"}


def error_row(numbers: Mapping[str, Any], kind: str) -> list[float | None]:
    """Six numbers, mm then degrees; ``kind`` is "max" or "static"."""
    return [*numbers[f"{kind}_mm"], *numbers[f"{kind}_deg"]]


def smallest_of_columns(rows: list[list[float | None]]) -> list[float | None]:
    """The smallest number of each column, None where a single row leaves nothing to compare."""
    if len(rows) < 2:
        return [None] * len(rows[0])
    columns = ([value for value in column if value is not None] for column in zip(*rows, strict=True))
    return [min(column, default=None) for column in columns]


def is_best(value: float | None, best: float | None) -> bool:
    """Whether a number shows as the smallest of its column: equal digits are equally good."""
    return value is not None and best is not None and format_cell(value) == format_cell(best)


def format_cell(value: float | None) -> str:
    """Three digits after the point, a dash where there is no number."""
    return "–" if value is None else f"{value:.3f}"

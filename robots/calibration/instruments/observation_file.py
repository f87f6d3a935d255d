"""Tables of several targets and instruments, a line for each target that an instrument saw.

Columns: ``q1_rad`` ... ``q6_rad`` or ``_deg``; ``target`` and ``instrument``, names (one target ``tool``, one
instrument, where the columns are missing); ``x_m``, ``y_m``, ``z_m`` or ``_mm``, empty where a coordinate was
not seen; ``distance_m`` or ``_mm`` in place of them; ``sigma_m`` or ``_mm`` if the line's standard deviation
is known; ``payload_kg`` at the flange, none where the column is missing. Lines that follow each other with
the same joint positions and the same load are one configuration.
"""

import math
from pathlib import Path

import numpy as np

from robots.calibration.instruments.observations import Observations
from robots.calibration.measurement_file import COPY, MeasurementFileError, RowProblem
from robots.description.model import NUM_JOINTS
from robots.text_table import TextTable, TextTableError, finite_number, parse_fields, read_text

_UNITS = {"kg": 1.0, "rad": 1.0, "deg": math.pi / 180.0, "m": 1.0, "mm": 1e-3}
_JOINTS = tuple(f"q{number}" for number in range(1, NUM_JOINTS + 1))


def names_targets(path: str | Path) -> bool:
    """Whether a table is one of targets or instruments, by its columns. Raises MeasurementFileError."""
    try:
        header = parse_fields(read_text(path), str(path), has_head=True).rows[0]
    except TextTableError as error:
        raise MeasurementFileError(f"measurements {error}") from error
    return any(name in ("target", "instrument") or name.startswith("distance_") for name in header)


def read_observations(path: str | Path) -> tuple[Observations, list[RowProblem]]:
    """Reads a table; lines that cannot be used are left out and named.

    Raises:
        MeasurementFileError: if it cannot be read, lacks a column, has a line with more fields than the head,
            or no usable line.
    """
    try:
        table = parse_fields(read_text(path), str(path), has_head=True)
        table.refuse_longer_rows()
    except TextTableError as error:
        raise MeasurementFileError(f"measurements {error}") from error
    columns = _Columns(table)
    q, loads, kept, problems, copies = [], [], [], [], table.copies()
    for line, row in zip(table.lines[1:], table.rows[1:], strict=True):
        try:
            found = columns.values(row), columns.joints(row), columns.payload(row)
            if line in copies:
                raise ValueError(COPY)
            kept.append((line, *found[0]))
            q.append(found[1])
            loads.append(found[2])
        except ValueError as error:
            problems.append(RowProblem(line, str(error)))
    if not kept:
        why = f"; {problems[0].what}" if problems else ""
        raise MeasurementFileError(f"measurements {path}: no usable row{why}")
    lines, targets, instruments, positions, distances, sigmas = zip(*kept, strict=True)
    joints, payload = np.array(q), np.array(loads)
    is_other = np.any(np.diff(joints, axis=0) != 0.0, axis=1) | (np.diff(payload) != 0.0)
    is_new = np.append(True, is_other)
    target_names, instrument_names = (tuple(dict.fromkeys(names)) for names in (targets, instruments))
    try:
        seen = Observations(
            joints[is_new],
            np.cumsum(is_new) - 1,
            np.array([target_names.index(name) for name in targets]),
            np.array([instrument_names.index(name) for name in instruments]),
            np.array(positions),
            np.array(distances),
            np.array(sigmas),
            np.array(lines),
            target_names,
            instrument_names,
            payload[is_new],
        )
    except ValueError as error:
        raise MeasurementFileError(f"measurements {path}: {error}") from error
    return seen, problems


class _Columns:
    """Where a table has what, in which unit."""

    def __init__(self, table: TextTable) -> None:
        self._table, self._header = table, table.rows[0]
        twice = {name for name in self._header if name and self._header.count(name) > 1}
        if twice:
            raise MeasurementFileError(f"measurements {table.name}: column {min(twice)} is there twice")
        self._q = [self._find(name, ("rad", "deg"), True) for name in _JOINTS]
        self._xyz = [self._find(name, ("m", "mm"), False) for name in "xyz"]
        self._distance = self._find("distance", ("m", "mm"), False)
        self._sigma = self._find("sigma", ("m", "mm"), False)
        self._payload = self._find("payload", ("kg",), False)
        if all(place is None for place in (*self._xyz, self._distance)):
            raise MeasurementFileError(
                f"measurements {table.name}: there are neither coordinates nor distances"
            )

    def _find(self, name: str, units: tuple[str, ...], is_needed: bool) -> tuple[str, int, float] | None:
        for unit in units:
            if f"{name}_{unit}" in self._header:
                return f"{name}_{unit}", self._header.index(f"{name}_{unit}"), _UNITS[unit]
        if is_needed:
            wanted = " or ".join(f"{name}_{unit}" for unit in units)
            raise MeasurementFileError(f"measurements {self._table.name}: column {wanted} is missing")
        return None

    def joints(self, row: list[str]) -> list[float]:
        """Joint positions in rad. Raises ValueError."""
        values = [self._number(row, place) for place in self._q]
        if np.isnan(values).any():
            raise ValueError("a joint position is missing")
        return values

    def payload(self, row: list[str]) -> float:
        """The mass at the flange in kg, zero where nothing stands. Raises ValueError."""
        value = self._number(row, self._payload)
        if value < 0.0:
            raise ValueError(f"payload_kg must not be negative, got {value:g}")
        return 0.0 if math.isnan(value) else value

    def values(self, row: list[str]) -> tuple[str, str, list[float], float, float]:
        """Target, instrument, coordinates, distance and sigma of a row in m. Raises ValueError."""
        position = [self._number(row, place) for place in self._xyz]
        distance, sigma = self._number(row, self._distance), self._number(row, self._sigma)
        if np.isnan(position).all() == np.isnan(distance):
            raise ValueError("needs coordinates or a distance, and not both")
        if sigma <= 0.0 or distance <= 0.0:
            raise ValueError("a distance and a sigma must be positive")
        return (
            self._name(row, "target", "tool"),
            self._name(row, "instrument", "instrument"),
            position,
            distance,
            sigma,
        )

    def _name(self, row: list[str], column: str, default: str) -> str:
        place = self._header.index(column) if column in self._header else len(row)
        name = row[place] if place < len(row) else default
        if not name:
            raise ValueError(f"{column} is empty")
        return name

    def _number(self, row: list[str], place: tuple[str, int, float] | None) -> float:
        """In SI units, NaN where the field is empty. Raises ValueError."""
        if place is None or place[1] >= len(row) or not row[place[1]]:
            return math.nan
        value = finite_number(row[place[1]], self._table.separator)
        if value is None:
            raise ValueError(f"{place[0]} is not a finite number: '{row[place[1]]}'")
        return value * place[2]

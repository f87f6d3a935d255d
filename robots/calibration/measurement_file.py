"""Tables of measured poses as text files whose column names carry the units.

One row a measurement, fields separated by commas, or by semicolons or tabulators (then decimal commas are
read, too), lines that begin with # are comments. Columns:
``q1_rad`` ... ``q6_rad`` or ``q1_deg`` ...; ``x_m``, ``y_m``, ``z_m`` or ``x_mm`` ...; for the orientation
``qw``, ``qx``, ``qy``, ``qz``, or the ZYX Euler angles ``alpha_deg``, ``beta_deg``, ``gamma_deg`` (also in
``_rad``), or none of them; ``payload_kg`` if there is one; standard deviations of the row as
``sigma_joint_deg``, ``sigma_position_mm``, ``sigma_rotation_deg`` (or ``_rad``, ``_m``) as far as they are
known. Other columns are left alone. A configuration may be there more than once, but a row with all the same
numbers as an earlier one is a copy and left out.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from robots.calibration.measurements import Measurements
from robots.description.model import NUM_JOINTS
from robots.pose import rotation_from_zyx
from robots.text_table import TextTable, TextTableError, finite_number, parse_fields, read_text

COPY = "a copy of an earlier line, not another measurement"
_JOINTS = tuple(f"q{number}" for number in range(1, NUM_JOINTS + 1))
_AXES, _QUATERNION, _EULER = ("x", "y", "z"), ("qw", "qx", "qy", "qz"), ("alpha", "beta", "gamma")
_UNITS = {"rad": 1.0, "deg": math.pi / 180.0, "m": 1.0, "mm": 1e-3}
_LARGEST = {"rad": 8.0, "deg": 800.0, "m": 20.0, "mm": 20000.0}  # beyond it the unit must be wrong
_MEANT = {"rad": "degrees", "m": "millimetres", "deg": "something else", "mm": "something else"}
_QUATERNION_TOLERANCE = 1e-3  # of the length; it is normalised
_SIGMAS = {"sigma_joint": ("rad", "deg"), "sigma_position": ("m", "mm"), "sigma_rotation": ("rad", "deg")}


class MeasurementFileError(ValueError):
    """A table cannot be used: a column is missing, a unit is wrong, or nothing is left of it."""


@dataclass(frozen=True)
class RowProblem:
    """A row that was left out, and why."""

    row: int  # number of the line in the file, the header included
    what: str


def read_measurements(path: str | Path) -> tuple[Measurements, list[RowProblem]]:
    """Reads a table. Rows that cannot be used are left out and named.

    Raises:
        MeasurementFileError: if the file cannot be read, lacks a column, has a row with more fields than the
            head or a number that only another unit explains, or has no usable row.
    """
    try:
        return parse_measurements(read_text(path), str(path))
    except TextTableError as error:
        raise MeasurementFileError(f"measurements {error}") from error


def parse_measurements(text: str, name: str = "table") -> tuple[Measurements, list[RowProblem]]:
    """Reads a table from its text, as `read_measurements`; ``name`` is where it came from."""
    try:
        table = parse_fields(text, name, has_head=True)
        table.refuse_longer_rows()
    except TextTableError as error:
        raise MeasurementFileError(f"measurements {error}") from error
    try:
        return _measurements(table)
    except MeasurementFileError as error:
        raise MeasurementFileError(f"measurements {name}: {error}") from error


def _measurements(table: TextTable) -> tuple[Measurements, list[RowProblem]]:
    columns = _Columns(table.rows[0])
    problems: list[RowProblem] = []
    rows, numbers, copies = [], [], table.copies()
    for line, row in zip(table.lines[1:], table.rows[1:], strict=True):
        try:
            values = columns.numbers(row, table.separator)
        except ValueError as error:
            problems.append(RowProblem(line, str(error)))
            continue
        columns.refuse_wrong_units(values, line)
        if line in copies:
            problems.append(RowProblem(line, COPY))
            continue
        rows.append(values)
        numbers.append(line)
    if not rows:
        raise MeasurementFileError(
            f"no usable row; {problems[0].what}" if problems else "no row but the header"
        )
    measurements, more = columns.measurements(np.array(rows), np.array(numbers))
    return measurements, sorted(problems + more, key=lambda problem: problem.row)


class _Columns:
    """Which columns of a file hold what, in which unit."""

    def __init__(self, header: list[str]) -> None:
        twice = {name for name in header if name and header.count(name) > 1}
        if twice:
            raise MeasurementFileError(f"column {min(twice)} is there twice")
        self._places: list[int] = []
        self._units: list[str] = []
        self._names: list[str] = []
        for name in _JOINTS:
            self._take(header, name, ("rad", "deg"))
        for name in _AXES:
            self._take(header, name, ("m", "mm"))
        self._orientation = ""
        if any(name in header for name in _QUATERNION):
            self._orientation = "quaternion"
            for name in _QUATERNION:
                self._take(header, name, ("",))
        elif any(f"{name}_{unit}" in header for name in _EULER for unit in ("deg", "rad")):
            self._orientation = "euler"
            for name in _EULER:
                self._take(header, name, ("deg", "rad"))
        self._has_payload = "payload_kg" in header
        if self._has_payload:
            self._take(header, "payload_kg", ("",))
        self._sigmas = [
            name for name, units in _SIGMAS.items() if any(f"{name}_{unit}" in header for unit in units)
        ]
        for name in self._sigmas:
            self._take(header, name, _SIGMAS[name])

    def _take(self, header: list[str], name: str, units: tuple[str, ...]) -> None:
        for unit in units:
            full = f"{name}_{unit}" if unit else name
            if full in header:
                self._places.append(header.index(full))
                self._units.append(unit)
                self._names.append(full)
                return
        wanted = " or ".join(f"{name}_{unit}" if unit else name for unit in units)
        raise MeasurementFileError(f"column {wanted} is missing; there are {', '.join(header)}")

    def numbers(self, row: list[str], separator: str | None = None) -> list[float]:
        """The numbers of a row in the units of the file. Raises ValueError."""
        values = []
        for place, name in zip(self._places, self._names, strict=True):
            text = row[place] if place < len(row) else ""
            value = finite_number(text, separator)
            if value is None:
                raise ValueError(f"{name} is not a finite number: '{text}'")
            if value < 0.0 and name == "payload_kg":
                raise ValueError(f"payload_kg must not be negative, got {text}")
            if value <= 0.0 and name.startswith("sigma_"):
                raise ValueError(f"{name} must be positive, got {text}")
            values.append(value)
        return values

    def refuse_wrong_units(self, values: list[float], line: int) -> None:
        """Refuses a number that is too large for the unit of its column."""
        for value, unit, name in zip(values, self._units, self._names, strict=True):
            if unit and abs(value) > _LARGEST[unit]:
                raise MeasurementFileError(
                    f"line {line}: {name} is {value:g}, more than any {unit} can be here; "
                    f"the column seems to hold {_MEANT[unit]}"
                )

    def measurements(self, table: np.ndarray, lines: np.ndarray) -> tuple[Measurements, list[RowProblem]]:
        """The table in SI units, without rows that contradict themselves or each other."""
        table = table * [_UNITS.get(unit, 1.0) for unit in self._units]
        q, position = table[:, :NUM_JOINTS], table[:, NUM_JOINTS : NUM_JOINTS + 3]
        rest = table[:, NUM_JOINTS + 3 :]
        good, problems = np.ones(len(q), dtype=bool), []
        rotation = None
        if self._orientation == "quaternion":
            lengths = np.linalg.norm(rest[:, :4], axis=1)
            for k in np.flatnonzero(np.abs(lengths - 1.0) > _QUATERNION_TOLERANCE):
                good[k] = False
                problems.append(
                    RowProblem(int(lines[k]), f"the quaternion has the length {lengths[k]:.4g}, not 1")
                )
            unit = np.where(good[:, None], rest[:, :4], [1.0, 0.0, 0.0, 0.0])
            rotation = Rotation.from_quat(unit, scalar_first=True).as_matrix()
        elif self._orientation == "euler":
            rotation = rotation_from_zyx(rest[:, :3])
        behind = rest[:, {"quaternion": 4, "euler": 3, "": 0}[self._orientation] :]
        payload = behind[:, 0] if self._has_payload else np.zeros(len(q))
        sigmas = np.full((len(q), len(_SIGMAS)), np.nan)
        for column, name in enumerate(self._sigmas, int(self._has_payload)):
            sigmas[:, list(_SIGMAS).index(name)] = behind[:, column]
        if not good.any():
            raise MeasurementFileError(f"no usable row; {problems[0].what}")
        sigmas = sigmas if self._sigmas else np.zeros((0, len(_SIGMAS)))
        return Measurements(q, position, rotation, payload, lines, sigmas).select(good), problems


def measurement_text(measurements: Measurements) -> str:
    """The table as text that `parse_measurements` reads back to the last digit but for the orientation."""
    header = [f"{name}_rad" for name in _JOINTS] + [f"{name}_m" for name in _AXES]
    columns = [measurements.q, measurements.position]
    if measurements.rotation is not None:
        header += _QUATERNION
        columns.append(Rotation.from_matrix(measurements.rotation).as_quat(canonical=True, scalar_first=True))
    header.append("payload_kg")
    columns.append(measurements.payload[:, None])
    for name, sigma in zip(_SIGMAS, measurements.sigmas.T, strict=True):
        if np.isfinite(sigma).all() and len(sigma):
            header.append(f"{name}_{_SIGMAS[name][0]}")
            columns.append(sigma[:, None])
    table = np.column_stack(columns)
    lines = [",".join(header), *(",".join(map(repr, row)) for row in table.tolist())]
    return "\n".join(lines) + "\n"

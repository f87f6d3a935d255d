"""A table that grows by a row whenever a configuration is measured, and says where to go on."""

import os
from pathlib import Path

import numpy as np

from diagrams.runs.guided_measurement import Row
from experiments.cli.staging import check_folder_of, make_folder_of
from robots.calibration.measurement_file import measurement_text, read_measurements
from robots.calibration.measurements import Measurements
from robots.description.model import NUM_JOINTS
from robots.text_table import TextTableError, finite_number, parse_fields, read_text

_SAME = np.deg2rad(0.5)  # rad, by which a joint may be off the configuration that was measured there
_UNITS = {"rad": 1.0, "deg": np.pi / 180.0}


def read_configurations(path: str | Path) -> np.ndarray:
    """Joint positions of a table with columns ``q1_rad`` ... or ``q1_deg`` ..., (n, 6) in rad.

    Raises:
        ValueError: if it cannot be read; one line.
    """
    try:
        table = parse_fields(read_text(path), str(path), has_head=True)
        table.refuse_longer_rows()
    except TextTableError as error:
        raise ValueError(f"configurations {error}") from error
    head = table.rows[0]
    twice = {name for name in head if name and head.count(name) > 1}
    if twice:
        raise ValueError(f"configurations {path}: column {min(twice)} is there twice")
    for unit in _UNITS:
        names = [f"q{number}_{unit}" for number in range(1, NUM_JOINTS + 1)]
        if all(name in head for name in names):
            places = [head.index(name) for name in names]
            break
    else:
        raise ValueError(
            f"configurations {path}: columns q1_rad ... q6_rad or q1_deg ... are needed, there are {head}"
        )
    rows = []
    for number, row in enumerate(table.rows[1:], 1):
        values = [finite_number(row[k], table.separator) if k < len(row) else None for k in places]
        if None in values:
            raise ValueError(f"configurations {table.where(number)}: not six finite joint positions")
        rows.append(values)
    if not rows:
        raise ValueError(f"configurations {path}: no row but the header")
    return _UNITS[unit] * np.array(rows, dtype=float)


class MeasuredTable:
    """The rows of a measurement run, each on the disk as soon as it is there."""

    def __init__(self, path: Path, q: np.ndarray, payload: float) -> None:
        """Reads what an earlier run has left.

        Args:
            path: of the file; its folder is made with its first row.
            q: the configurations of the design, (n, 6) in rad.
            payload: at the flange in kg.

        Raises:
            OSError: if it cannot be written.
            ValueError: if its rows are not of this design and load.
        """
        self.path, self._payload = path, payload
        self.measured: set[int] = set()
        check_folder_of(path)
        if not path.exists():
            return
        found, problems = read_measurements(path)
        if problems:
            raise ValueError(f"{path}, line {problems[0].row}: {problems[0].what}; it cannot be continued")
        for line, place, load in zip(found.rows, found.q, found.payload, strict=True):
            off = np.abs(q - place).max(axis=1)
            near = [int(row) + 1 for row in np.argsort(off) if off[row] <= _SAME]
            if not near or load != payload:
                raise ValueError(
                    f"{path}, line {line}: measured at another configuration or load than this run has; "
                    "name another file with --write"
                )
            # A design may visit a configuration more than once.
            self.measured.add(next((number for number in near if number not in self.measured), near[0]))

    def append(self, number: int, row: Row) -> None:
        """Takes what was measured at the configuration with a number; on the disk when it returns."""
        q, position, rotation = row
        text = measurement_text(
            Measurements(q[None], position[None], rotation[None], np.array([self._payload]))
        )
        make_folder_of(self.path)
        is_new = not self.path.exists()
        with self.path.open("a", encoding="utf-8") as file:
            file.write(text if is_new else text.splitlines(keepends=True)[1])
            file.flush()
            os.fsync(file.fileno())
        self.measured.add(number)

"""Recorded motions as a table with a head, and the column map that says what its columns are.

The map is a YAML file with the name of the table beside it (``run.csv`` has ``run.yaml``): which column is
the case, the time, the positions of the motors, and for each sensor its place and its columns.
`write_recording` writes both for a simulated recording.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pydrake.common.yaml import yaml_dump_typed
from scipy.interpolate import CubicSpline

from experiments.report.files import write_text
from robots.configuration.nodes import Node, read_nodes
from robots.configuration.quantity import choice, numbers, positive, quantity
from robots.configuration.typed import typed
from robots.description.model import NUM_JOINTS
from robots.identification.motion import KINDS, SensorPlace
from robots.identification.recording import RecordedCase, RecordingError
from robots.pose import rotation_from_zyx, zyx_from_rotation
from robots.text_table import TextTable, finite_number, parse_fields, read_text

_UNEVEN = 0.01  # of the period, by which samples of the robot may be off an even grid
_LEAST = 50  # samples of a case


@dataclass
class RecordedSensor:
    """A sensor and its three columns."""

    name: str = ""
    kind: str = choice("gyro", KINDS)
    body: str = ""
    position: list[float] = numbers((0.0, 0.0, 0.0), (3,), unit="m")
    zyx_deg: list[float] = numbers((0.0, 0.0, 0.0), (3,), unit="deg")
    bandwidth: float = positive(200.0, "Hz")
    noise_sigma: float = positive(2e-3)  # rad/s or m/s^2
    columns: list[str] = field(default_factory=list)
    factor: float = 1.0  # from the unit of the columns to rad/s or m/s^2


@dataclass
class RecordingMap:
    """What the columns of a recording are."""

    payload: float | None = quantity(None, 0.0, unit="kg")  # at the flange; None for the largest
    case: str = "case"  # column with the name of the motion; empty where there is only one
    time: str = "time"  # column, s by the robot's clock
    stamp: str = ""  # column, s by the clock of the sensors; empty for that of the robot
    angle_factor: float = 1.0  # from the unit of positions and speeds to rad and rad/s
    position: list[str] = field(default_factory=list)  # six columns, motors on the side of the links
    speed: list[str] = field(default_factory=list)  # six columns; empty: differentiated
    torque: list[str] = field(default_factory=list)  # six columns, N m on the side of the links; may be empty
    sensors: list[RecordedSensor] = field(default_factory=list)


@dataclass(frozen=True)
class Recording:
    """What was read."""

    payload: float | None  # kg
    cases: list[RecordedCase]
    sensors: list[SensorPlace]


def read_recording(path: Path, columns: Path | None = None, needs_sensors: bool = True) -> Recording:
    """Reads a table and its map.

    Args:
        path: of the table.
        columns: of the map; None for the file with the suffix .yaml beside it.
        needs_sensors: whether motors alone are too little.

    Raises:
        ConfigurationError: if the map is missing or wrong.
        TextTableError: if the table cannot be read.
        RecordingError: if columns are missing, hold no numbers, or times do not go on evenly.
    """
    mapped = columns or path.with_suffix(".yaml")
    node = read_nodes(mapped, f"column map {mapped}")
    plan = typed(node, RecordingMap)
    _check(plan, node, needs_sensors)
    table = parse_fields(read_text(path), str(path), has_head=True)
    values = _Columns(table)
    names = values.texts(plan.case) if plan.case else ["1"] * (len(table.rows) - 1)
    time = values.numbers([plan.time])[:, 0]
    stamps = values.numbers([plan.stamp])[:, 0] if plan.stamp else time
    theta = plan.angle_factor * values.numbers(plan.position)
    rate = plan.angle_factor * values.numbers(plan.speed) if plan.speed else None
    torque = values.numbers(plan.torque) if plan.torque else None
    readings = np.zeros((len(time), len(plan.sensors), 3))
    for i, sensor in enumerate(plan.sensors):
        readings[:, i] = sensor.factor * values.numbers(sensor.columns)
    cases = []
    for name in dict.fromkeys(names):
        rows = np.flatnonzero(np.array(names) == name)
        _check_times(table, rows, time, stamps)
        speed = (
            rate[rows] if rate is not None else CubicSpline(time[rows], theta[rows]).derivative()(time[rows])
        )
        torques = torque[rows] if torque is not None else np.zeros((0, NUM_JOINTS))
        cases.append(
            RecordedCase(name, time[rows], theta[rows], speed, torques, stamps[rows], readings[rows])
        )
    _check_periods(path, cases)
    return Recording(plan.payload, cases, [_place(sensor) for sensor in plan.sensors])


def write_recording(path: Path, recording: Recording) -> None:
    """Writes a table and its map beside it.

    Raises:
        OSError: if a file cannot be written.
    """
    joints = range(1, NUM_JOINTS + 1)
    has_torque = all(len(case.torque) for case in recording.cases)
    plan = RecordingMap(
        recording.payload,
        stamp="stamp",
        position=[f"position_{i}" for i in joints],
        speed=[f"speed_{i}" for i in joints],
        torque=[f"torque_{i}" for i in joints] if has_torque else [],
        sensors=[
            RecordedSensor(
                place.name,
                place.kind,
                place.body,
                place.position.tolist(),
                np.rad2deg(zyx_from_rotation(place.rotation)).tolist(),
                place.bandwidth,
                place.sigma,
                [f"{place.name}_{axis}" for axis in "xyz"],
            )
            for place in recording.sensors
        ],
    )
    head = [plan.case, plan.time, plan.stamp, *plan.position, *plan.speed, *plan.torque]
    head += [column for sensor in plan.sensors for column in sensor.columns]
    lines = [",".join(head)]
    for case in recording.cases:
        n = min(len(case.time), len(case.stamps))
        parts = [case.time[:n, None], case.stamps[:n, None], case.theta[:n], case.rate[:n]]
        parts += [case.torque[:n]] if has_torque else []
        rows = np.hstack([*parts, case.readings[:n].reshape(n, -1)])
        lines += [f"{case.name}," + ",".join(f"{value:.9g}" for value in row) for row in rows]
    write_text(path, "\n".join(lines) + "\n")
    write_text(path.with_suffix(".yaml"), str(yaml_dump_typed(plan)))


class _Columns:
    """The columns of a table by their names."""

    def __init__(self, table: TextTable) -> None:
        self._table, self._head = table, table.rows[0]
        for row, fields in enumerate(table.rows):
            if len(fields) != len(self._head):
                raise RecordingError(
                    f"{table.where(row)}: {len(fields)} fields, but the head has {len(self._head)}"
                )

    def _place(self, name: str) -> int:
        if name not in self._head:
            raise RecordingError(f"{self._table.name}: no column '{name}', there are {', '.join(self._head)}")
        return self._head.index(name)

    def texts(self, name: str) -> list[str]:
        """A column as it is written."""
        place = self._place(name)
        return [fields[place] for fields in self._table.rows[1:]]

    def numbers(self, names: list[str]) -> np.ndarray:
        """Columns as numbers, (rows, columns)."""
        places = [self._place(name) for name in names]
        found = np.empty((len(self._table.rows) - 1, len(names)))
        for row, fields in enumerate(self._table.rows[1:]):
            for column, place in enumerate(places):
                value = finite_number(fields[place], self._table.separator)
                if value is None:
                    raise RecordingError(
                        f"{self._table.where(row + 1)}: '{fields[place]}' in column '{names[column]}' is "
                        "no number"
                    )
                found[row, column] = value
        return found


def _check(plan: RecordingMap, node: Node, needs_sensors: bool) -> None:
    for name, wanted in (
        ("position", (NUM_JOINTS,)),
        ("speed", (0, NUM_JOINTS)),
        ("torque", (0, NUM_JOINTS)),
    ):
        columns = getattr(plan, name)
        if len(columns) not in wanted:
            raise node.at([name]).refuse(f"{name} must be {NUM_JOINTS} columns, got {len(columns)}")
    if not plan.sensors and needs_sensors:
        raise node.refuse("sensors: needs one or more, each with name, kind, body and three columns")
    for i, sensor in enumerate(plan.sensors):
        if len(sensor.columns) != 3:
            place = node.at(["sensors", i])
            raise place.refuse(f"sensor '{sensor.name}': columns must be 3, got {len(sensor.columns)}")


def _check_times(table: TextTable, rows: np.ndarray, time: np.ndarray, stamps: np.ndarray) -> None:
    where = table.where(int(rows[0]) + 1)
    if len(rows) < _LEAST:
        raise RecordingError(f"{where}: a case needs {_LEAST} rows or more, got {len(rows)}")
    for name, values in (("time", time[rows]), ("stamp", stamps[rows])):
        steps = np.diff(values)
        if not steps.min() > 0.0:
            row = int(rows[int(np.argmin(steps)) + 1]) + 1
            raise RecordingError(f"{table.where(row)}: the {name} does not go on")
    steps = np.diff(time[rows])
    period = float(np.median(steps))
    if np.abs(steps - period).max() > _UNEVEN * period:
        row = int(rows[int(np.argmax(np.abs(steps - period))) + 1]) + 1
        raise RecordingError(
            f"{table.where(row)}: samples of the robot must be evenly spaced, got {steps.max():g} s "
            f"after {period:g} s"
        )


def _check_periods(path: Path, cases: list[RecordedCase]) -> None:
    periods = [case.period for case in cases]
    if max(periods) > (1.0 + _UNEVEN) * min(periods):
        raise RecordingError(
            f"{path}: all cases must have one period, got {min(periods):g} to {max(periods):g} s"
        )


def _place(sensor: RecordedSensor) -> SensorPlace:
    return SensorPlace(
        sensor.name,
        sensor.kind,
        sensor.body,
        np.array(sensor.position, dtype=float),
        rotation_from_zyx(np.deg2rad(sensor.zyx_deg)),
        sensor.bandwidth,
        sensor.noise_sigma,
    )

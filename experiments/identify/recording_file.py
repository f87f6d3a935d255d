"""Recorded motions in files: tables with a map of their columns, and MCAP files.

A table is text with a head (CSV) or Parquet. Its map is a YAML file with the name of the table beside it
(``run.csv`` has ``run.yaml``): which column is the case, the time, the positions of the motors, and for each
sensor its place and its columns. MCAP files say these things themselves.
"""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import typer
from pydrake.common.yaml import yaml_dump_typed
from scipy.interpolate import CubicSpline

from experiments.identify.recording_columns import PARQUET, read_columns
from experiments.identify.recording_grid import filled_note
from experiments.identify.recording_map import (
    Recording,
    RecordingMap,
    check_map,
    check_payloads,
    check_periods,
    check_times,
    map_of,
    places,
)
from experiments.identify.recording_mcap import MCAP, read_mcap, write_mcap
from experiments.report.files import write_text
from robots.configuration.nodes import read_nodes
from robots.configuration.typed import typed
from robots.description.model import NUM_JOINTS
from robots.identification.recording import RecordedCase, RecordingError

RECORDINGS = (".csv", ".txt", PARQUET, MCAP)


def read_recording(path: Path, columns: Path | None = None, needs_sensors: bool = True) -> Recording:
    """Reads a table and its map, or an MCAP file.

    Args:
        path: of the file; its suffix says which kind it is.
        columns: of the map of a table; None for the file with the suffix .yaml beside it.
        needs_sensors: whether motors alone are too little.

    Raises:
        ConfigurationError: if the map is missing or wrong.
        TextTableError: if the table cannot be read.
        RecordingError: if columns are missing, hold no numbers, or times do not go on evenly.
        ValueError: if it is no MCAP file.
        OSError: if a file cannot be read.
    """
    if path.suffix.lower() == MCAP:
        if columns is not None:
            raise RecordingError(f"{path}: an MCAP file needs no column map: it says what it holds")
        return read_mcap(path, needs_sensors)
    with path.open("rb"):  # a table that is not there, or is a folder, is named before its map
        pass
    mapped = columns or path.with_suffix(".yaml")
    if columns is None and not mapped.is_file():
        raise RecordingError(
            f"{path}: there is no {mapped}, which says what its columns are; --columns names another"
        )
    node = read_nodes(mapped, f"column map {mapped}")
    plan = typed(node, RecordingMap)
    check_map(plan, node, needs_sensors)
    table = read_columns(path)
    time = table.numbers([plan.time])[:, 0]
    if not len(time):
        raise RecordingError(f"{path}: no row but the header")
    names = table.texts(plan.case) if plan.case else ["1"] * len(time)
    stamps = table.numbers([plan.stamp])[:, 0] if plan.stamp else time
    theta = plan.angle_factor * table.numbers(plan.position)
    rate = plan.angle_factor * table.numbers(plan.speed) if plan.speed else None
    torque = table.numbers(plan.torque) if plan.torque else None
    commands = None
    if plan.command:
        units = np.array([plan.angle_factor, plan.angle_factor, 1.0])[:, None]
        commands = units * table.numbers(plan.command).reshape(-1, 3, NUM_JOINTS)
    readings = np.zeros((len(time), len(plan.sensors), 3))
    for i, sensor in enumerate(plan.sensors):
        readings[:, i] = sensor.factor * table.numbers(sensor.columns)
    cases, grids = [], []
    for name in dict.fromkeys(names):
        rows = np.flatnonzero(np.array(names) == name)
        grid = check_times(lambda row, rows=rows: table.where(int(rows[row])), time[rows], stamps[rows])
        grids.append(grid)
        times, angles = grid.linear(time[rows]), grid.smooth(theta[rows])
        speed = (
            grid.smooth(rate[rows]) if rate is not None else CubicSpline(times, angles).derivative()(times)
        )
        torques = grid.linear(torque[rows]) if torque is not None else np.zeros((0, NUM_JOINTS))
        told = grid.following(commands[rows]) if commands is not None else None
        cases.append(
            RecordedCase(
                name,
                times,
                angles,
                speed,
                torques,
                stamps[rows],
                readings[rows],
                told,
                plan.payloads.get(name),
            )
        )
    check_payloads(mapped, plan, cases)
    check_periods(path, cases)
    if note := filled_note(path, grids):
        typer.echo(f"truetip: recording {note}", err=True)
    return Recording(plan.payload, cases, places(plan), plan.command_period)


def write_recording(path: Path, recording: Recording) -> None:
    """Writes a table and its map beside it, or an MCAP file, as the suffix says.

    Raises:
        OSError: if a file cannot be written.
    """
    if path.suffix.lower() == MCAP:
        write_mcap(path, recording)
        return
    has_torque = all(len(case.torque) for case in recording.cases)
    has_command = all(case.commands is not None for case in recording.cases)
    plan = map_of(recording, has_torque, has_command)
    head = [plan.time, plan.stamp, *plan.position, *plan.speed, *plan.torque, *plan.command]
    head += [column for sensor in plan.sensors for column in sensor.columns]
    names, blocks = [], []
    for case in recording.cases:
        n = min(len(case.time), len(case.stamps))
        parts = [case.time[:n, None], case.stamps[:n, None], case.theta[:n], case.rate[:n]]
        parts += [case.torque[:n]] if has_torque else []
        parts += [case.commands[:n].reshape(n, -1)] if case.commands is not None and has_command else []
        blocks.append(np.hstack([*parts, case.readings[:n].reshape(n, -1)]))
        names += n * [case.name]
    rows = np.concatenate(blocks)
    if path.suffix.lower() == PARQUET:
        columns = {plan.case: names} | dict(zip(head, rows.T, strict=True))
        pq.write_table(pa.table(columns), path, compression="zstd")
    else:
        lines = [",".join([plan.case, *head])]
        lines += [
            f"{name}," + ",".join(f"{v:.9g}" for v in row) for name, row in zip(names, rows, strict=True)
        ]
        write_text(path, "\n".join(lines) + "\n")
    write_text(path.with_suffix(".yaml"), str(yaml_dump_typed(plan)))

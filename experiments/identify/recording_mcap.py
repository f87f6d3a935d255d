"""Recorded motions as an MCAP file: the record of any run, or motions in a row with their sensors.

A run has ``/joint_sample``: positions and torques of its motors. A recording of several motions has
``/motion`` where each of them begins, and ``/inertial_sample`` with what the sensors showed; where these sit
stands in its metadata, as in the map of a table. ``/drive_command`` has what the drives were told.
"""

from pathlib import Path

import numpy as np
import typer
from pydrake.common.yaml import yaml_dump_typed
from scipy.interpolate import CubicSpline

from diagrams.record.read_record import Contents, Topic, read_record
from diagrams.record.run_record import RunRecord
from diagrams.record.topics import INERTIAL, JOINTS, MOTION, TOLD
from experiments.identify.recording_grid import filled_note
from experiments.identify.recording_map import (
    Recording,
    RecordingMap,
    check_payloads,
    check_periods,
    check_times,
    map_of,
    places,
)
from robots.configuration.nodes import parse
from robots.configuration.typed import typed
from robots.description.model import NUM_JOINTS
from robots.identification.recording import RecordedCase, RecordingError

MCAP = ".mcap"
_PAUSE = 1.0  # s, between motions in the file
_SENSORS = "sensors"  # of the metadata
_TOLD: tuple[str, ...] = ("position", "velocity", "torque")
_WITHIN = 1e-6  # s, to which stamps are sure


def read_mcap(path: Path, needs_sensors: bool = True) -> Recording:
    """Reads the record of a run or of several motions.

    Velocities are the derivatives of splines through the positions.

    Args:
        path: of the file.
        needs_sensors: whether motors alone are too little.

    Raises:
        OSError: if it cannot be read.
        ValueError: if it is no MCAP file, or does not hold what is needed; one line.
    """
    contents = read_record(path)
    joints = contents.topics.get(JOINTS)
    if joints is None:
        raise RecordingError(f"{path}: the motion of the motors is not known, {contents.lacking(JOINTS)}")
    if contents.cut:
        typer.echo(f"truetip: recording {path} {contents.cut}; what is there is used", err=True)
    plan = _plan(contents, path)
    shown = contents.topics.get(INERTIAL)
    if needs_sensors and (shown is None or not plan.sensors):
        raise RecordingError(
            f"{path}: no messages of {INERTIAL}: a run without gyros and accelerometers shows load and "
            "friction (--slow), but no springs"
        )
    names, bounds = _motions(contents, path, joints)
    cases, grids = [], []
    for name, begin, end in zip(names, bounds[:-1], bounds[1:], strict=True):
        inside = _between(joints.time, begin, end)
        stamp = joints.columns["stamp"][inside, 0]
        time = joints.time[inside] if np.isnan(stamp).any() else stamp
        theta = joints.columns["position"][inside]
        torque = joints.columns["effort"][inside]
        grid = check_times(lambda row, name=name: f"{path}, motion {name}, sample {row + 1}", time, time)
        if not np.isfinite(theta).all():
            raise RecordingError(f"{path}, motion {name}: positions of motors are missing")
        grids.append(grid)
        time, theta = grid.linear(time), grid.smooth(theta)
        stamps, readings = _readings(shown, begin, end, len(plan.sensors), time)
        rate = CubicSpline(time, theta).derivative()(time)
        known = grid.linear(torque) if np.isfinite(torque).all() else np.zeros((0, NUM_JOINTS))
        told = _told(contents.topics.get(TOLD), grid.linear(joints.time[inside]), begin)
        load = plan.payloads.get(name)
        cases.append(RecordedCase(name, time, theta, rate, known, stamps, readings, told, load))
    check_payloads(path, plan, cases)
    check_periods(path, cases)
    if note := filled_note(path, grids):
        typer.echo(f"truetip: recording {note}", err=True)
    return Recording(plan.payload, cases, places(plan), plan.command_period)


def write_mcap(path: Path, recording: Recording) -> None:
    """Writes all motions, one after the other.

    Raises:
        OSError: if the file cannot be written.
    """
    record = RunRecord(path, "")
    begin = 0.0
    for case in recording.cases:
        record.write(MOTION, begin, {"name": case.name})
        unknown = np.full(NUM_JOINTS, np.nan)
        for n, (time, theta) in enumerate(zip(case.time.tolist(), case.theta, strict=True)):
            torque = case.torque[n] if len(case.torque) else unknown
            message = {"stamp": time, "position": theta.tolist(), "effort": _numbers(torque)}
            record.write(JOINTS, begin + time - case.time[0], message)
        before = None
        for time, told in zip(
            case.time.tolist(), () if case.commands is None else case.commands, strict=False
        ):
            if before is None or (told != before).any():
                message = dict(zip(_TOLD, told.tolist(), strict=True))
                record.write(TOLD, begin + time - case.time[0], message)
            before = told
        for stamp, shown in zip(case.stamps.tolist(), case.readings, strict=True):
            at = begin + stamp - case.stamps[0]
            record.write(INERTIAL, at, {"stamp": stamp, "readings": shown.ravel().tolist()})
        begin += max(np.ptp(case.time), np.ptp(case.stamps)) + _PAUSE
    plan = map_of(recording, has_torque=True, has_command=False)
    record.close(**{_SENSORS: str(yaml_dump_typed(plan))})
    if record.problem:
        raise OSError(record.problem)


def _plan(contents: Contents, path: Path) -> RecordingMap:
    if _SENSORS not in contents.run:
        return RecordingMap()
    return typed(parse(str(contents.run[_SENSORS]), f"sensors of {path}", has_lines=False), RecordingMap)


def _motions(contents: Contents, path: Path, joints: Topic) -> tuple[list[str], np.ndarray]:
    """Names of the motions, and where they begin and the last one ends, in s."""
    begun = contents.topics.get(MOTION)
    if begun is None:
        return [path.stem], np.array([joints.time[0], np.inf])
    return [str(name) for name in begun.columns["name"][:, 0]], np.append(begun.time, np.inf)


def _between(time: np.ndarray, begin: float, end: float) -> np.ndarray:
    return (time > begin - _WITHIN) & (time < end - _WITHIN)


def _readings(
    shown: Topic | None, begin: float, end: float, sensors: int, time: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Stamps (m,) and readings (m, sensors, 3) of a motion; the robot's times where there are no sensors."""
    if shown is None or not sensors:
        return time, np.zeros((len(time), 0, 3))
    inside = _between(shown.time, begin, end)
    return shown.columns["stamp"][inside, 0], shown.columns["readings"][inside].reshape(-1, sensors, 3)


def _told(told: Topic | None, times: np.ndarray, begin: float) -> np.ndarray | None:
    """What the drives were told last at times of a motion that begins at some time in s, (n, 3, 6)."""
    if told is None:
        return None
    last = np.searchsorted(told.time, times + _WITHIN, side="right") - 1
    if last[0] < 0 or told.time[last[0]] < begin - _WITHIN:
        return None
    return np.stack([told.columns[name][last] for name in _TOLD], axis=1)


def _numbers(values: np.ndarray) -> list[float | None]:
    return [value if value == value else None for value in values.tolist()]

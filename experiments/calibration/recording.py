"""Measurements from the record of a run: joints and exposures of an MCAP file, and where the robot rested."""

from pathlib import Path

import numpy as np
import typer

from diagrams.record.read_record import Contents, read_record
from diagrams.record.restored import exposures
from diagrams.record.topics import JOINTS, POSE
from diagrams.scenario.differences import scenario_tree
from robots.calibration.dwells import DwellRule, Recording, RecordingError, dwell_measurements
from robots.calibration.measurements import Measurements
from robots.description.model import RobotModel
from robots.kinematics.forward import Kinematics


def recorded_measurements(path: str | Path, robot: RobotModel, rule: DwellRule | None = None) -> Measurements:
    """The table of a record, a row for each dwell, with the load that its scenario names.

    Args:
        path: of an MCAP file with joints and exposures, also of one that was cut off.
        robot: the nominal one, by which the clocks are aligned.
        rule: what a dwell is.

    Raises:
        OSError: if it cannot be read.
        ValueError: if it is no record, or holds nothing to calibrate with; one line.
    """
    contents = read_record(path)
    if lacking := contents.lacking(JOINTS, POSE):
        raise ValueError(f"recording {path}: {lacking}")
    if contents.cut:
        typer.echo(f"truetip: recording {path} {contents.cut}; what is there is used", err=True)
    joints = contents.topics[JOINTS]
    time, unique = np.unique(joints.time, return_index=True)
    recording = Recording(time, joints.columns["position"][unique], *exposures(contents.topics[POSE]))
    try:
        return dwell_measurements(recording, Kinematics(robot), rule, _payload(contents))[0]
    except RecordingError as error:
        raise ValueError(f"recording {path}: {error}") from error


def _payload(contents: Contents) -> float:
    """The load at the flange in kg; nothing where the record does not say."""
    station = scenario_tree(contents.scenario).get("station")
    return float(station.get("payload") or 0.0) if isinstance(station, dict) else 0.0

"""Figures of the joints: commands, speeds against their limits, torques and the deflection of the gears."""

import numpy as np

from diagrams.record.log import RunLog
from experiments.metrics.run_metrics import Comparison
from experiments.report.panels import Axes, Panel
from robots.description.model import NUM_JOINTS, RobotModel

_FITTED = "The range fits the path; double-click for what the start did."


def joint_panels(logs: Comparison, robot: RobotModel | None) -> list[Panel]:
    """The panels that there are numbers for; without a robot speeds have no limit to compare them with."""
    first = {law: cycles[0] for law, cycles in logs.items()}
    commanded, speeds, torques, yielded = (
        {law: read(log) for law, log in first.items()}
        for read in (_commands, _speeds, _torques, _deflections)
    )
    speed_unit = "degrees/s"
    limits = np.empty(0)
    if robot is not None:
        speeds = {law: 100.0 * np.deg2rad(speed) / robot.speed for law, speed in speeds.items()}
        speed_unit, limits = "% of the limit", np.array([-100.0, 100.0])
    panels = [
        _panel(
            "joint-commands",
            "Joint commands",
            "Positions that the controller sends. Laws that use the camera differ from the open loop by the "
            "correction that the errors of the robot need.",
            "degrees",
            commanded,
            first,
        ),
        _panel(
            "joint-speeds",
            "Speeds against their limits",
            "Speeds that the controller sends. A command that runs along a dotted line is held by the guard."
            if len(limits)
            else "Speeds that the controller sends.",
            speed_unit,
            speeds,
            first,
            limits,
        ),
        _panel(
            "joint-torques",
            "Torques",
            "On the link side of the gear, as the robot reports them: weight at rest, inertia and friction "
            "in motion; ripples are vibration or a restless correction. " + _FITTED,
            "N m",
            torques,
            first,
            fits_path=True,
        ),
        _panel(
            "gear-deflection",
            "Deflection of the gears",
            "True position of the link minus that of the motor seen behind its gear: the sag under the load, "
            "and around it the vibration that no encoder of a motor sees. " + _FITTED,
            "arcmin",
            yielded,
            first,
            fits_path=True,
        ),
    ]
    return [panel for panel in panels if not panel.is_empty]


def _panel(
    id: str,
    title: str,
    note: str,
    unit: str,
    values: dict[str, np.ndarray],
    logs: dict[str, RunLog],
    limits: np.ndarray | None = None,
    fits_path: bool = False,
) -> Panel:
    dotted = [] if limits is None else limits.tolist()
    axes = [
        Axes("time in s", unit, f"joint {number}", limits=dotted, over_time=True, fits_path=fits_path)
        for number in range(1, NUM_JOINTS + 1)
    ]
    curves = {
        law: [(logs[law].time, columns[:, joint]) for joint in range(NUM_JOINTS)]
        for law, columns in values.items()
        if np.isfinite(columns).any() and np.abs(columns[np.isfinite(columns)]).max() > 0.0
    }
    return Panel(id, title, note, axes, curves)


def _commands(log: RunLog) -> np.ndarray:
    return np.rad2deg(log.position_command)


def _speeds(log: RunLog) -> np.ndarray:
    return np.rad2deg(log.velocity_command)


def _torques(log: RunLog) -> np.ndarray:
    return log.joint_effort


def _deflections(log: RunLog) -> np.ndarray:
    return 60.0 * np.rad2deg(log.link_position - log.joint_position)

"""The robot at the instant of its largest error, for each law."""

from typing import Any

import numpy as np

from experiments.metrics.run_metrics import Comparison, judged_source, known_poses, path_window, pose_errors
from experiments.report.curves import rounded
from experiments.report.robot_plot import joint_origins
from robots.description.model import RobotModel

PATH_POINTS = 300


def worst_instants(logs: Comparison, robot: RobotModel) -> dict[str, Any]:
    """What the script of the page draws, positions in mm.

    Args:
        logs: law -> one log per cycle; the first cycle is drawn.
        robot: with the geometry that it truly has.
    """
    wanted = next(iter(logs.values()))[0].X_WE_desired[:, :3, 3]
    keep = np.unique(np.linspace(0, len(wanted) - 1, PATH_POINTS).astype(int))
    return {
        "path": _columns(wanted[keep]),
        "laws": {law: _worst(cycles[0], robot) for law, cycles in logs.items()},
    }


def _worst(log: Any, robot: RobotModel) -> dict[str, Any]:
    distance = np.linalg.norm(pose_errors(log, judged_source(log))[:, 3:], axis=1)
    distance = np.where(path_window(log) & np.isfinite(distance), distance, -1.0)
    worst = int(np.argmax(distance))
    q = log.link_position[worst]
    arm = joint_origins(robot, q if np.isfinite(q).all() else log.joint_position[worst])
    wanted, found = log.X_WE_desired[worst, :3, 3], known_poses(log)[worst, :3, 3]
    return {
        "time": round(float(log.time[worst]), 4),
        "distance": rounded(distance[worst : worst + 1] * 1e3)[0],
        "arm": _columns(arm),
        "wanted": rounded(1e3 * wanted),
        "deviation": rounded(1e3 * (found - wanted)),
    }


def _columns(points: np.ndarray) -> list[list[float | None]]:
    return [rounded(1e3 * points[:, axis]) for axis in range(3)]

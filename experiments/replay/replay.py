"""The replay of a comparison: one HTML file in which the robot moves, and which plays offline.

The robot moves as its links truly did, with the geometry that it truly had. Deviations from the wanted pose
are a thousandth of what one sees of a robot, so the page magnifies them as arrows and trails.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.common import FindResourceOrThrow

from diagrams.record.log import RunLog
from experiments.metrics.run_metrics import known_poses, path_window
from experiments.replay.replay_data import replay_data
from experiments.replay.robot_shapes import robot_shapes
from experiments.report.curves import rounded
from experiments.report.packed import packed
from experiments.report.page import write_page
from robots.description.model import RobotModel
from robots.pose import pose_error
from systems.cell.marker_camera import MarkerCameraConfig
from systems.vision.camera_rig import load_cell
from systems.vision.marker_body import load_body


@dataclass(frozen=True)
class Watchers:
    """The cameras around a robot and the markers on its tool.

    Attributes:
        cameras: their poses in the world, z along the view, shape (n, 4, 4).
        markers: centres in the tool's frame in m, shape (m, 3).
        diameter: of a marker in m.
    """

    cameras: np.ndarray = field(default_factory=lambda: np.empty((0, 4, 4)))
    markers: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    diameter: float = 0.016


def watchers(camera: Any, robot: RobotModel) -> Watchers:
    """Cameras and markers of a camera's configuration; none for a camera that only gives poses.

    Raises:
        ValueError: if the files of cell or body are not there any more.
    """
    if not isinstance(camera, MarkerCameraConfig):
        return Watchers()
    body = load_body(camera.body)
    cameras = load_cell(camera.cell).camera_model(robot.base.pose())
    X_WC = np.tile(np.eye(4), (len(cameras.p_WC), 1, 1))
    X_WC[:, :3, :3], X_WC[:, :3, 3] = cameras.R_WC, cameras.p_WC
    return Watchers(X_WC, body.p_E, body.diameter)


def write_replay(
    path: str | Path,
    robot: RobotModel,
    logs: Mapping[str, RunLog],
    shown_law: str | None = None,
    seen_by: Watchers | None = None,
) -> None:
    """Writes the replay as one self-contained HTML file, atomically.

    Args:
        path: where to.
        robot: with the geometry that it truly has.
        logs: law -> log, all on the same path.
        shown_law: whose robot is there at first; None takes the law with the smallest largest error.
        seen_by: cameras and markers; None for none.

    Raises:
        OSError: if the folder is missing or cannot be written.
        ValueError: if ``shown_law`` is not among the logs.
    """
    shown_law = shown_law or _best(logs)
    if shown_law not in logs:
        raise ValueError(f"replay: no log of law '{shown_law}', there are {', '.join(logs)}")
    seen_by = seen_by or Watchers()
    data = replay_data(logs, shown_law) | {
        "robot": robot_shapes(robot),
        "cameras": [rounded(X.reshape(-1), 7) for X in seen_by.cameras],
        "markers": [rounded(p, 7) for p in seen_by.markers],
        "marker_radius": 0.5 * seen_by.diameter,
    }
    write_page(
        path, "replay.html", library=packed(_viewer()), title="truetip replay", laws=data["laws"], data=data
    )


def _viewer() -> str:
    """The script of Meshcat, which brings three.js with it."""
    return Path(FindResourceOrThrow("drake/geometry/meshcat.js")).read_text(encoding="utf-8")


def _best(logs: Mapping[str, RunLog]) -> str:
    laws = [law for law in logs if law != "open_loop"] or list(logs)

    def largest(law: str) -> float:
        e = pose_error(logs[law].X_WE_desired, known_poses(logs[law]))[path_window(logs[law])]
        return float(np.linalg.norm(e[:, 3:], axis=1).max(initial=0.0))

    return min(laws, key=largest)

"""The replay of a comparison: a meshcat recording in one HTML file that plays offline.

The robot moves as its links truly did, with the geometry that it truly had, so that its tool meets the true
path. Deviations are drawn to scale.
"""

from collections.abc import Mapping
from html import escape
from pathlib import Path

import numpy as np
from pydrake.geometry import MeshcatAnimation, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from diagrams.record.log import RunLog
from experiments.metrics.run_metrics import known_poses, path_window
from experiments.replay.scene import FRAME_RATE, RobotPicture, draw_frame, draw_path, open_meshcat, rgba
from experiments.report.files import write_text
from experiments.report.style import WANTED_COLOR, law_colors, law_file_name, law_title
from robots.description.geometric_errors import GeometricErrors
from robots.description.model import RobotModel
from robots.pose import pose_error

TIP_RADIUS = 0.006  # m
WANTED_RADIUS = 0.003  # m; the wanted path is a translucent tube, which a true path 3 mm off leaves
PATH_RADIUS = 0.0015  # m


def write_replay(
    path: str | Path,
    robot: RobotModel,
    logs: Mapping[str, RunLog],
    errors: GeometricErrors | None = None,
    shown_law: str | None = None,
) -> None:
    """Writes the recording as one self-contained HTML file, atomically.

    One law's robot moves, with frames at its true tool and at the wanted pose; the other laws show their tips
    and paths. Everything can be switched off in the scene tree: ``robot``, ``wanted`` and one entry per law.

    Args:
        logs: law -> log, all on the same path.
        errors: the true geometry of the robot; None for exact geometry.
        shown_law: whose robot moves; None takes the law with the smallest largest error.

    Raises:
        OSError: if the folder is missing or cannot be written.
        ValueError: if ``shown_law`` is not among the logs.
    """
    shown_law = shown_law or _best(logs)
    if shown_law not in logs:
        raise ValueError(f"replay: no log of law '{shown_law}', there are {', '.join(logs)}")
    shown = logs[shown_law]
    # Nothing connects to the server, the page is all we want: any port will do.
    meshcat = open_meshcat(shown.X_WE_desired[:, :3, 3], port=0)
    times = np.arange(shown.time[0], shown.time[-1] + 0.5 / FRAME_RATE, 1.0 / FRAME_RATE)
    _record_robot(RobotPicture(meshcat, robot, errors), shown, times)
    animation = meshcat.get_mutable_recording()
    colors = law_colors(logs)
    on_path = path_window(shown)
    wanted = shown.X_WE_desired[on_path, :3, 3]
    draw_path(meshcat, "wanted/path", wanted, WANTED_RADIUS, rgba(WANTED_COLOR, 0.5))
    draw_frame(meshcat, "wanted/frame", length=0.14, radius=0.0018, alpha=0.45)
    _animate(animation, "wanted/frame", shown.time, shown.X_WE_desired, times)
    for law, log in logs.items():
        X_WE = known_poses(log)
        p_WE, place = X_WE[path_window(log), :3, 3], law_file_name(law)
        draw_path(meshcat, f"{place}/path", p_WE, PATH_RADIUS, rgba(colors[law]))
        if law == shown_law:
            draw_frame(meshcat, f"{place}/tip", length=0.1, radius=0.003, alpha=1.0)
        else:
            meshcat.SetObject(f"{place}/tip", Sphere(TIP_RADIUS), rgba(colors[law]))
        _animate(animation, f"{place}/tip", log.time, X_WE, times)
    animation.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    meshcat.PublishRecording()
    write_text(path, _with_legend(meshcat.StaticHtml(), colors, shown_law))


def _best(logs: Mapping[str, RunLog]) -> str:
    laws = [law for law in logs if law != "open_loop"] or list(logs)

    def largest(law: str) -> float:
        e = pose_error(logs[law].X_WE_desired, known_poses(logs[law]))[path_window(logs[law])]
        return float(np.linalg.norm(e[:, 3:], axis=1).max(initial=0.0))

    return min(laws, key=largest)


def _record_robot(picture: RobotPicture, log: RunLog, times: np.ndarray) -> None:
    """Records the robot at the true link positions; starts the recording that others add to."""
    positions = np.stack([np.interp(times, log.time, log.link_position[:, i]) for i in range(6)], -1)
    picture.visualizer.StartRecording(set_transforms_while_recording=True)
    for time, q in zip(times - times[0], positions, strict=True):
        picture.show(time, q)
    picture.visualizer.StopRecording()


def _animate(
    animation: MeshcatAnimation, path: str, log_time: np.ndarray, X: np.ndarray, times: np.ndarray
) -> None:
    """Moves an object along sampled poses (n, 4, 4), taking the sample nearest to each frame."""
    nearest = np.clip(np.searchsorted(log_time, times), 0, len(log_time) - 1)
    for time, i in zip(times - times[0], nearest, strict=True):
        R = RotationMatrix.ProjectToRotationMatrix(X[i, :3, :3])
        pose = RigidTransform(R, X[i, :3, 3])
        animation.SetTransform(animation.frame(time), path, pose)


def _with_legend(html: str, colors: Mapping[str, str], shown_law: str) -> str:
    """Names the colours in a corner of the page."""
    entries = {"wanted, 3 mm radius": WANTED_COLOR}
    entries |= {
        law_title(law) + (" (robot)" if law == shown_law else ""): color for law, color in colors.items()
    }
    lines = "".join(
        f'<div><span style="display:inline-block;width:18px;height:4px;border-radius:2px;margin-right:8px;'
        f'vertical-align:middle;background:{color}"></span>{escape(title)}</div>'
        for title, color in entries.items()
    )
    legend = (
        '<div id="legend" style="position:fixed;left:14px;bottom:14px;padding:10px 14px;border-radius:8px;'
        "background:rgba(255,255,255,.85);color:#1c2430;font:14px/1.6 system-ui,sans-serif;"
        'pointer-events:none">'
        f"{lines}</div>"
    )
    html = html.replace("<title>Drake MeshCat</title>", "<title>truetip replay</title>")
    head, closing, tail = html.rpartition("</body>")
    return head + legend + closing + tail

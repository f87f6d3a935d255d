"""The measuring cell: poses, lenses, windows and rates of its cameras, read from one YAML file.

A cell file is the dataclass tree below, field for field. Every part carries a ``source``: where its numbers
come from, or the word ``assumed``. Positions are those of the camera system's own frame Q (a calibration
gives them so); ``base`` is the robot's base B in that frame.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from pydrake.math import RigidTransform

from robots.description.model import Placement
from robots.pose import rotation_from_zyx
from systems.vision.camera_model import Cameras
from systems.vision.data_file import Problem, load_data_file

_IN_METRES = 20.0  # mm; a cell in metres by mistake is no larger, and two cameras are no nearer to each other


@dataclass
class Lens:
    """Intrinsic parameters of a camera, in OpenCV's terms."""

    focal_length_px: np.ndarray = field(default_factory=lambda: np.zeros(2))  # along u and v
    principal_point_px: np.ndarray = field(default_factory=lambda: np.zeros(2))
    radial: np.ndarray = field(default_factory=lambda: np.zeros(3))  # k1, k2, k3 on normalised coordinates
    tangential: np.ndarray = field(default_factory=lambda: np.zeros(2))  # p1, p2
    source: str = ""


@dataclass
class CellCamera:
    """One camera of a cell."""

    name: str = ""
    position_mm: np.ndarray = field(default_factory=lambda: np.zeros(3))  # of the optical centre in Q
    # Of the camera frame in Q; none if the camera is level and sees the target amid its window.
    zyx_deg: list[float] = field(default_factory=list)
    window_px: np.ndarray = field(default_factory=lambda: np.zeros(4))  # u0, v0, u1, v1
    lens: Lens = field(default_factory=Lens)
    source: str = ""


@dataclass
class MeasuringCell:
    """The cameras around a robot. Load one with `load_cell`."""

    name: str = ""
    sensor_px: np.ndarray = field(default_factory=lambda: np.zeros(2))  # width and height
    frame_rate_hz: float = 0.0
    sensor_source: str = ""
    base: Placement = field(default_factory=Placement)
    target_mm: np.ndarray = field(default_factory=lambda: np.zeros(3))  # in the robot's base frame
    target_source: str = ""
    cameras: list[CellCamera] = field(default_factory=list)

    @property
    def windows(self) -> np.ndarray:
        """The parts of the images that are looked at in px: u0, v0, u1, v1, (n, 4)."""
        return np.array([camera.window_px for camera in self.cameras])

    def camera_model(self, X_WB: RigidTransform | None = None) -> Cameras:
        """The cameras in the world; ``X_WB`` is the robot's base, None if it is the world's origin.

        Raises:
            ValueError: if a camera is impossible.
        """
        X_WQ = (X_WB or RigidTransform()) @ self.base.pose().inverse()
        R_WQ = X_WQ.rotation().matrix()
        lenses = [camera.lens for camera in self.cameras]
        p_QC = 1e-3 * np.array([camera.position_mm for camera in self.cameras])
        target_Q = self.base.pose().multiply(1e-3 * self.target_mm)
        unturned = Cameras(
            focal=np.array([lens.focal_length_px for lens in lenses]),
            center=np.array([lens.principal_point_px for lens in lenses]),
            radial=np.array([lens.radial for lens in lenses]),
            tangential=np.array([lens.tangential for lens in lenses]),
            R_WC=np.tile(np.eye(3), (len(lenses), 1, 1)),
            p_WC=p_QC,
        )
        middle = 0.5 * (self.windows[:, :2] + self.windows[:, 2:])
        rays = unturned.directions(middle)  # in the frames of the cameras
        R_QC = [
            rotation_from_zyx(np.deg2rad(camera.zyx_deg)) if camera.zyx_deg else _aimed(ray, target_Q - p)
            for camera, ray, p in zip(self.cameras, rays, p_QC, strict=True)
        ]
        p_WC = p_QC @ R_WQ.T + X_WQ.translation()
        return replace(unturned, R_WC=R_WQ @ np.array(R_QC), p_WC=p_WC)


def load_cell(name: str) -> MeasuringCell:
    """Reads a shipped cell by name (``"probst"``) or any cell file by its path.

    Raises:
        ValueError: if there is no such file, or it does not describe a cell; one line that names file and
            line.
    """
    return load_data_file(name, "cell", MeasuringCell, _problem)


def _aimed(ray_C: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """The rotation of a level camera (its x axis is horizontal) that turns a ray of it into a direction."""
    x, y, z = ray_C
    dx, dy, dz = direction / np.linalg.norm(direction)
    # With the optical axis raised by e, the ray rises by -y cos(e) + z sin(e), which must be dz.
    e = np.arctan2(y, z) + np.arcsin(dz / np.hypot(y, z))
    ahead = y * np.sin(e) + z * np.cos(e)  # along the horizontal direction that the camera faces
    pan = np.arctan2(dy, dx) - np.arctan2(-x, ahead)
    facing = np.array([np.cos(pan), np.sin(pan), 0.0])
    right = np.array([np.sin(pan), -np.cos(pan), 0.0])
    axis = np.cos(e) * facing + np.array([0.0, 0.0, np.sin(e)])
    return np.column_stack([right, np.cross(axis, right), axis])


def _problem(cell: MeasuringCell) -> Problem | None:
    """The first reason why the cell is impossible, or None."""
    if len(cell.cameras) < 2:
        return ["cameras"], f"needs at least two cameras, got {len(cell.cameras)}"
    if not 0.0 < cell.frame_rate_hz < np.inf:
        return ["frame_rate_hz"], f"frame_rate_hz must be positive, got {cell.frame_rate_hz}"
    if np.shape(cell.sensor_px) != (2,) or not np.all(np.asarray(cell.sensor_px) > 0.0):
        return ["sensor_px"], f"sensor_px must be a width and a height, got {cell.sensor_px}"
    if np.shape(cell.target_mm) != (3,) or not np.isfinite(cell.target_mm).all():
        return ["target_mm"], f"target_mm must be three finite numbers, got {cell.target_mm}"
    names = [camera.name for camera in cell.cameras]
    for number, camera in enumerate(cell.cameras):
        if camera.name in names[:number]:
            return ["cameras", number, "name"], f"two cameras have the name '{camera.name}'"
        problem = _camera_problem(camera, cell)
        if problem:
            place, reason = problem
            return ["cameras", number, *place], f"camera {camera.name}: {reason}"
    return None


def _camera_problem(camera: CellCamera, cell: MeasuringCell) -> Problem | None:
    lens = camera.lens
    sizes = {
        ("position_mm",): (camera.position_mm, 3),
        ("window_px",): (camera.window_px, 4),
        ("lens", "focal_length_px"): (lens.focal_length_px, 2),
        ("lens", "principal_point_px"): (lens.principal_point_px, 2),
        ("lens", "radial"): (lens.radial, 3),
        ("lens", "tangential"): (lens.tangential, 2),
    }
    for place, (value, size) in sizes.items():
        if np.shape(value) != (size,) or not np.isfinite(value).all():
            return place, f"{place[-1]} must be {size} finite numbers, got {value}"
    if camera.zyx_deg and not (len(camera.zyx_deg) == 3 and np.isfinite(camera.zyx_deg).all()):
        return ["zyx_deg"], f"zyx_deg must be three finite angles or none, got {camera.zyx_deg}"
    if 0.0 < np.linalg.norm(camera.position_mm) < _IN_METRES:
        return [
            "position_mm"
        ], f"position_mm is {camera.position_mm}, hardly off the origin: is it in metres?"
    if not np.all(lens.focal_length_px > 0.0):
        return ["lens", "focal_length_px"], (
            f"focal_length_px must be positive, or the camera matrix is singular, got {lens.focal_length_px}"
        )
    u0, v0, u1, v1 = camera.window_px
    width, height = cell.sensor_px
    if not (0 <= u0 < u1 <= width and 0 <= v0 < v1 <= height):
        return ["window_px"], f"window_px must lie in 0, 0, {width:g}, {height:g}, got {camera.window_px}"
    return None

"""How uncertain a measured tool pose is, by its causes: a budget after the GUM (JCGM 100:2008, section 5).

Every cause is carried to the pose by its derivative; independent causes add as covariances. What is said of
cameras goes through the images: a camera that is not where it is believed shifts what it sees, and the best
fit of the body to all images moves by (J^T J)^-1 J^T times these shifts.
"""

from dataclasses import dataclass, fields

import numpy as np

from systems.vision.camera_model import Cameras
from systems.vision.tracking.pose_refinement import linearize

IMAGES, CAMERAS, TOOL, TIME, TEMPERATURE = "images", "cameras", "tool", "time stamps", "temperature"
_LEAST_INFORMATION = 1.0  # px^2 per m^2 or rad^2, below which a pose is not seen


@dataclass(frozen=True)
class Uncertainties:
    """Standard uncertainties of what a measured pose depends on; each camera, axis and pose its own draw."""

    pixel: float = 0.1  # px, of a marker along u and v
    camera_position: float = 5e-5  # m, of each camera along each axis
    camera_rotation: float = 1e-5  # rad, about each axis
    tool_position: float = 2e-5  # m, of the tool in the frame of the markers, along each axis
    tool_rotation: float = 5e-5  # rad
    time_stamp: float = 1e-4  # s, between the clocks of camera and robot
    temperature: float = 1.0  # K, half width of the even distribution of the cell's temperature
    frame_expansion: float = 1.2e-5  # 1/K, of what the cameras are fixed to; steel
    body_expansion: float = 2.3e-5  # 1/K, of the marker body; aluminium

    def __post_init__(self) -> None:
        """Raises ValueError if one is negative or not finite."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not 0.0 <= value < np.inf:
                raise ValueError(f"uncertainty {field.name} must be zero or positive, got {value}")


@dataclass(frozen=True)
class MeasuredPose:
    """A pose, how it moves, and which markers each camera sees."""

    X_WE: np.ndarray  # (4, 4)
    V_WE: np.ndarray  # (6,) rad/s and m/s
    seen: np.ndarray  # (n, m) bool


def covariances(
    cameras: Cameras, p_E: np.ndarray, anchor_W: np.ndarray, pose: MeasuredPose, given: Uncertainties
) -> dict[str, np.ndarray]:
    """The covariance (6, 6) of a measured pose by cause, rotation vector in rad first, then m, in the world.

    Args:
        cameras: as they are believed, n of them.
        p_E: markers in the body, (m, 3) in m.
        anchor_W: the place of the frame of the cameras that stays where it is when it grows, (3,) in m.
        pose: where it is measured.
        given: standard uncertainties.

    Returns:
        By cause; NaN where the pose is not seen.
    """
    X, V = pose.X_WE, pose.V_WE
    _, J = linearize(cameras, p_E, X)
    seen = pose.seen & np.isfinite(J).all(axis=(2, 3))
    rows = np.where(seen[..., None, None], J, 0.0)  # (n, m, 2, 6)
    information = np.einsum("nmui,nmuj->ij", rows, rows)
    if not np.linalg.eigvalsh(information)[0] > _LEAST_INFORMATION:
        return {name: np.full((6, 6), np.nan) for name in (IMAGES, CAMERAS, TOOL, TIME, TEMPERATURE)}
    inverse = np.linalg.inv(information)
    by_point = rows[..., 3:]  # derivatives by the places of the markers
    arm = p_E @ X[:3, :3].T
    from_camera = arm + X[:3, 3] - cameras.p_WC[:, None]  # (n, m, 3)
    # By a shift and a turn of each camera: what it sees goes the other way.
    gain = np.einsum("ij,nmuj->inmu", inverse, rows)
    by_shift = -np.einsum("inmu,nmuk->nik", gain, by_point)
    by_turn = -np.einsum("inmu,nmuk->nik", gain, _turned(by_point, from_camera))
    cameras_part = given.camera_position**2 * np.einsum("nik,njk->ij", by_shift, by_shift)
    cameras_part += given.camera_rotation**2 * np.einsum("nik,njk->ij", by_turn, by_turn)
    tool = np.diag([given.tool_rotation**2] * 3 + [given.tool_position**2] * 3)
    # Everything grows at once: the frame moves all cameras away from its anchor, the body its markers.
    grown = given.frame_expansion * np.einsum("nik,nk->i", by_shift, cameras.p_WC - anchor_W)
    grown += given.body_expansion * np.einsum("inmu,nmuk,mk->i", gain, by_point, arm)
    return {
        IMAGES: given.pixel**2 * inverse,
        CAMERAS: cameras_part,
        TOOL: tool,
        TIME: given.time_stamp**2 * np.outer(V, V),
        TEMPERATURE: given.temperature**2 / 3.0 * np.outer(grown, grown),
    }


def _turned(by_point: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """Derivatives (n, m, 2, 3) by a rotation vector about where the arms (n, m, 3) begin."""
    return np.cross(arm[:, :, None], by_point)

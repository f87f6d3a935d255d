"""The parameters of a camera that a calibration estimates, their Jacobian, and small updates of them.

The fifteen parameters are those of OpenCV's lens model and the pose: `NAMES`. A change of the pose turns and
then shifts points in the camera frame, p_C -> exp(turn~) p_C + shift.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from systems.vision.camera_model import Cameras

LENS_NAMES = ("f_u", "f_v", "c_u", "c_v", "k1", "k2", "k3", "p1", "p2")
NAMES = (*LENS_NAMES, "turn_x", "turn_y", "turn_z", "x", "y", "z")
NUM_LENS = len(LENS_NAMES)
NUM = len(NAMES)


def moved_cameras(cameras: Cameras, change: np.ndarray) -> Cameras:
    """Cameras after a change of their parameters: px, lens coefficients, rad and m, shape (n, 15)."""
    turn = Rotation.from_rotvec(change[:, 9:12]).as_matrix()
    R_CW = turn @ cameras.R_CW
    p_CW = (turn @ cameras.p_CW[:, :, None])[:, :, 0] + change[:, 12:]
    return replace(
        cameras,
        focal=cameras.focal + change[:, :2],
        center=cameras.center + change[:, 2:4],
        radial=cameras.radial + change[:, 4:7],
        tangential=cameras.tangential + change[:, 7:9],
        R_WC=R_CW.swapaxes(1, 2),
        p_WC=-np.einsum("nji,nj->ni", R_CW, p_CW),
    )


def change_between(cameras: Cameras, others: Cameras) -> np.ndarray:
    """The change (n, 15) that makes others of cameras; the inverse of `moved_cameras`."""
    turn = others.R_CW @ cameras.R_WC
    shift = others.p_CW - (turn @ cameras.p_CW[:, :, None])[:, :, 0]
    lens = (
        getattr(others, name) - getattr(cameras, name) for name in ("focal", "center", "radial", "tangential")
    )
    return np.hstack([*lens, Rotation.from_matrix(turn).as_rotvec(), shift])


def project_with_parameters(cameras: Cameras, p_W: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pixels and all their derivatives.

    Args:
        cameras: n cameras.
        p_W: points in m, shape (k, 3).

    Returns:
        Pixels (n, k, 2), their derivatives by the parameters (n, k, 2, 15) and by the points (n, k, 2, 3);
        NaN for points that are not in front.
    """
    p_C = cameras.in_camera_frames(p_W)
    z = np.where(p_C[..., 2] > 0.0, p_C[..., 2], np.nan)
    x, y = p_C[..., 0] / z, p_C[..., 1] / z
    pixels, J_xy = cameras.through_lens(np.stack([x, y], -1))
    zero = np.zeros_like(x)
    # Of x and y by the point in the camera frame.
    fall = np.stack([np.stack([1.0 / z, zero, -x / z], -1), np.stack([zero, 1.0 / z, -y / z], -1)], -2)
    J_C = J_xy @ fall
    J = np.empty((*x.shape, 2, NUM))
    seen = (pixels - cameras.center[:, None]) / cameras.focal[:, None]
    J[..., :4] = 0.0
    J[..., 0, 0], J[..., 1, 1] = seen[..., 0], seen[..., 1]
    J[..., 0, 2] = J[..., 1, 3] = 1.0
    r2 = x * x + y * y
    across = np.stack([x, y], -1)
    bend = np.stack([r2, r2 * r2, r2 * r2 * r2], -1)
    lens = np.empty((*x.shape, 2, 5))
    lens[..., :3] = across[..., :, None] * bend[..., None, :]
    lens[..., 0, 3], lens[..., 0, 4] = 2.0 * x * y, r2 + 2.0 * x * x
    lens[..., 1, 3], lens[..., 1, 4] = r2 + 2.0 * y * y, 2.0 * x * y
    J[..., 4:9] = cameras.focal[:, None, :, None] * lens
    J[..., 9:12] = np.cross(p_C[..., None, :], J_C)
    J[..., 12:] = J_C
    return pixels, J, J_C @ cameras.R_CW[:, None]

"""What tests of the tracking share: the shipped cell and body, poses in front of it, and pictures of them."""

import numpy as np
from scipy.spatial.transform import Rotation

from systems.vision.camera_model import Cameras
from systems.vision.camera_rig import load_cell
from systems.vision.marker_body import load_body

CELL = load_cell("probst")
CAMERAS = CELL.camera_model()
BODY = load_body("probst")


def random_pose(rng: np.random.Generator, spread: float = 0.3) -> np.ndarray:
    """Any orientation, up to ``spread`` m along each axis from the middle of the path."""
    X = np.eye(4)
    X[:3, :3] = Rotation.random(None, rng).as_matrix()
    X[:3, 3] = np.array([0.45, 0.0, 0.4]) + rng.uniform(-spread, spread, 3)
    return X


def placed(X: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (m, 3) of a body at a pose (4, 4)."""
    return points @ X[:3, :3].T + X[:3, 3]


def shuffled(pixels: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (n, m, 2) in another order in each camera, and the marker of each blob, (n, m)."""
    order = rng.permuted(np.tile(np.arange(pixels.shape[1]), (len(pixels), 1)), axis=1)
    return np.take_along_axis(pixels, order[..., None], axis=1), order


def random_cameras(rng: np.random.Generator, n: int = 4) -> Cameras:
    """Cameras with strong lenses on a ring of 2 m about the origin, looking inwards."""
    R = Rotation.random(n, rng).as_matrix()
    return Cameras(
        focal=rng.uniform(800.0, 3000.0, (n, 2)),
        center=rng.uniform(400.0, 1500.0, (n, 2)),
        radial=np.array([-0.2, 0.05, 0.01]) * rng.uniform(0.5, 1.0, (n, 3)),
        tangential=rng.uniform(-2e-3, 2e-3, (n, 2)),
        R_WC=R,
        p_WC=-2.0 * R[:, :, 2],
    )

"""What a camera can see of points: in front of it, inside its window, and not behind the arm."""

import numpy as np

from robots.kinematics.arm_capsules import Capsules

_TINY = 1e-15  # m^2, squared lengths below this are points


def in_window(pixels: np.ndarray, windows: np.ndarray) -> np.ndarray:
    """Whether pixels lie in the windows of their cameras.

    Args:
        pixels: shape (n, m, 2), NaN for points behind a camera.
        windows: u0, v0, u1, v1 in px, shape (n, 4).

    Returns:
        Shape (n, m), False where a pixel is NaN.
    """
    low, high = windows[:, None, :2], windows[:, None, 2:]
    return np.all((pixels >= low) & (pixels <= high), -1)


def occluded(p_WC: np.ndarray, p_W: np.ndarray, capsules: Capsules) -> np.ndarray:
    """Whether the lines of sight from the cameras to the points meet a capsule.

    Args:
        p_WC: optical centres in m, shape (n, 3).
        p_W: points in m, shape (m, 3).
        capsules: in the world.

    Returns:
        Shape (n, m).
    """
    if not len(capsules.radius):
        return np.zeros((len(p_WC), len(p_W)), bool)
    distance2 = _segment_distance2(p_WC[:, None, None], p_W[:, None], capsules.start, capsules.end)
    return np.any(distance2 < capsules.radius**2, -1)


def _segment_distance2(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Squared distances between the segments from a to b and from c to d; (..., 3) each, broadcast.

    The nearest points a + s (b - a) and c + t (d - c) of the two lines are found first, t is brought into
    [0, 1], and s follows from t, as in Ericson, Real-Time Collision Detection, section 5.1.9.
    """
    u, v, w = b - a, d - c, a - c
    uu, vv = _dot(u, u), _dot(v, v)
    uv, uw, vw = _dot(u, v), _dot(u, w), _dot(v, w)
    uu, vv = np.maximum(uu, _TINY), np.maximum(vv, _TINY)
    slanted = uu * vv - uv * uv
    s = np.clip((uv * vw - uw * vv) / np.maximum(slanted, _TINY), 0.0, 1.0)
    t = np.clip((uv * s + vw) / vv, 0.0, 1.0)
    s = np.clip((uv * t - uw) / uu, 0.0, 1.0)
    gap = w + s[..., None] * u - t[..., None] * v
    return _dot(gap, gap)


def _dot(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", x, y)

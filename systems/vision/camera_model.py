"""Pinhole cameras with lens distortion: projection and back-projection, vectorised over cameras and points.

A camera frame C has its origin in the optical centre, z along the optical axis, x to the right and y down in
the image; pixels (u, v) count from the upper left corner. The lens shifts the normalised coordinates
x = X/Z, y = Y/Z radially with three and tangentially with two coefficients, in OpenCV's order and sense. This
is Probst (2024) eqs. (3.4) to (3.8), corrected: the source writes (3.8) on pixels, where r^2 would be in the
millions.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

_NEWTON_STEPS = 20
_CONVERGED = 1e-13  # change of the normalised coordinates; a ten thousandth of a millionth of a pixel


@dataclass(frozen=True)
class Cameras:
    """n cameras as arrays over the cameras."""

    focal: np.ndarray  # px, along u and v, (n, 2)
    center: np.ndarray  # px, the principal point, (n, 2)
    radial: np.ndarray  # k1, k2, k3, (n, 3)
    tangential: np.ndarray  # p1, p2, (n, 2)
    R_WC: np.ndarray  # camera frames in the world, (n, 3, 3)
    p_WC: np.ndarray  # optical centres in m, (n, 3)

    def __post_init__(self) -> None:
        """Checks shapes and values.

        Raises:
            ValueError: if a number is missing or not finite, a focal length is not positive, or a rotation
                is none.
        """
        n = len(self.p_WC)
        shapes = {"focal": 2, "center": 2, "radial": 3, "tangential": 2, "p_WC": 3}
        for name, size in shapes.items():
            value = getattr(self, name)
            if np.shape(value) != (n, size) or not np.isfinite(value).all():
                raise ValueError(f"cameras: {name} must be {n} x {size} finite numbers, got {value}")
        if not np.all(self.focal > 0.0):
            raise ValueError(f"cameras: focal lengths must be positive, got {self.focal.min()} px")
        R = self.R_WC
        if np.shape(R) != (n, 3, 3) or not np.allclose(R @ R.swapaxes(1, 2), np.eye(3), rtol=0.0, atol=1e-6):
            raise ValueError(f"cameras: R_WC must be {n} rotation matrices, got {R}")
        if not np.all(np.linalg.det(R) > 0.0):
            raise ValueError("cameras: R_WC must be rotation matrices, got a left-handed one")

    def __len__(self) -> int:
        return len(self.p_WC)

    def subset(self, chosen) -> "Cameras":
        """Some of the cameras: a list of indices, a mask or a slice."""
        return Cameras(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))

    @cached_property
    def R_CW(self) -> np.ndarray:
        """Rotations from the world into the cameras, (n, 3, 3)."""
        return np.ascontiguousarray(self.R_WC.swapaxes(1, 2))

    @cached_property
    def p_CW(self) -> np.ndarray:
        """The origin of the world seen by the cameras in m, (n, 3)."""
        return -np.einsum("nij,nj->ni", self.R_CW, self.p_WC)

    @cached_property
    def intrinsics(self) -> np.ndarray:
        """The camera matrices K of Probst (2024) eq. (3.5), (n, 3, 3)."""
        K = np.zeros((len(self), 3, 3))
        K[:, 0, 0], K[:, 1, 1] = self.focal.T
        K[:, :2, 2], K[:, 2, 2] = self.center, 1.0
        return K

    @cached_property
    def projections(self) -> np.ndarray:
        """Projection matrices P = K (R_CW | p_CW), Probst (2024) eq. (3.6), without lens, (n, 3, 4)."""
        return self.intrinsics @ np.concatenate([self.R_CW, self.p_CW[:, :, None]], axis=2)

    @cached_property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """Focal lengths, principal points, lenses and poses as `systems.vision.kernels` takes them."""
        each = self.focal, self.center, self.radial, self.tangential, self.R_CW, self.p_CW
        return tuple(np.ascontiguousarray(array, dtype=float) for array in each)

    def depth(self, p_W: np.ndarray) -> np.ndarray:
        """Distances of points (..., 3) in front of the image planes in m, (n, ...)."""
        p_W = np.asarray(p_W, dtype=float)
        z = self.R_CW[:, 2] @ p_W.reshape(-1, 3).T + self.p_CW[:, 2:]
        return z.reshape(len(self), *p_W.shape[:-1])

    def in_camera_frames(self, p_W: np.ndarray) -> np.ndarray:
        """Points (k, 3) of the world in the camera frames in m, (n, k, 3)."""
        return p_W @ self.R_WC + self.p_CW[:, None]

    def project(self, p_W: np.ndarray) -> np.ndarray:
        """Pixels of points in the world.

        Args:
            p_W: points in m, shape (..., 3).

        Returns:
            Pixels as the lens shows them, shape (n, ..., 2); NaN for points that are not in front.
        """
        p_W = np.asarray(p_W, dtype=float)
        x, y, _ = self._normalized_from_world(p_W)
        return self._pixels(*_distort(x, y, *self._lens)).reshape(len(self), *p_W.shape[:-1], 2)

    def project_with_jacobian(self, p_W: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (n, ..., 2) and their derivatives by the points, (n, ..., 2, 3) in px/m."""
        p_W = np.asarray(p_W, dtype=float)
        batch = (len(self), *p_W.shape[:-1])
        x, y, z = self._normalized_from_world(p_W)
        pixels = self._pixels(*_distort(x, y, *self._lens))
        xx, xy, yy = _distortion_jacobian(x, y, *self._lens)
        u, v = self.focal[:, :1] / z, self.focal[:, 1:] / z
        J_C = np.empty((*z.shape, 2, 3))
        J_C[..., 0, 0], J_C[..., 0, 1], J_C[..., 0, 2] = u * xx, u * xy, -u * (xx * x + xy * y)
        J_C[..., 1, 0], J_C[..., 1, 1], J_C[..., 1, 2] = v * xy, v * yy, -v * (xy * x + yy * y)
        J = (J_C.reshape(len(self), -1, 3) @ self.R_CW).reshape(*batch, 2, 3)
        return pixels.reshape(*batch, 2), J

    def through_lens(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """From normalised coordinates (n, k, 2) to pixels (n, k, 2) and their derivatives, (n, k, 2, 2)."""
        x, y = xy[..., 0], xy[..., 1]
        xx, both, yy = _distortion_jacobian(x, y, *self._lens)
        J = np.stack([xx, both, both, yy], -1).reshape(*x.shape, 2, 2) * self.focal[:, None, :, None]
        return self._pixels(*_distort(x, y, *self._lens)), J

    def normalized(self, pixels: np.ndarray) -> np.ndarray:
        """Normalised coordinates (x, y) behind the lens, the inverse of the distortion by Newton's method.

        Probst (2024) eq. (3.9) iterates x = (x_distorted - tangential(x)) / radial(x), which gains a fixed
        factor per step; Newton's method doubles the digits.

        Args:
            pixels: as the lens shows them, shape (n, ..., 2).

        Returns:
            Shape (n, ..., 2); NaN where no ray of the lens leads to the pixel.
        """
        pixels = np.asarray(pixels, dtype=float)
        flat = pixels.reshape(len(self), -1, 2)
        x_seen = (flat[..., 0] - self.center[:, :1]) / self.focal[:, :1]
        y_seen = (flat[..., 1] - self.center[:, 1:]) / self.focal[:, 1:]
        x, y, size = x_seen, y_seen, np.zeros_like(x_seen)
        xx, xy, yy = np.ones((3, *x.shape))
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for _ in range(_NEWTON_STEPS):
                x_now, y_now = _distort(x, y, *self._lens)
                dx, dy = x_seen - x_now, y_seen - y_now
                xx, xy, yy = _distortion_jacobian(x, y, *self._lens)
                scale = 1.0 / (xx * yy - xy * xy)
                step_x, step_y = scale * (yy * dx - xy * dy), scale * (xx * dy - xy * dx)
                x, y = x + step_x, y + step_y
                size = np.abs(step_x) + np.abs(step_y)
                if not (size > _CONVERGED).any():
                    break
            # Beyond the fold of a lens the iteration finds a ray on the wrong side of it, or none.
            found = (size <= _CONVERGED) & (xx + yy > 0.0) & (xx * yy > xy * xy)
        return np.where(found[..., None], np.stack([x, y], -1), np.nan).reshape(pixels.shape)

    def undistort(self, pixels: np.ndarray) -> np.ndarray:
        """Pixels (n, ..., 2) where an ideal pinhole would have shown them, Probst (2024) eq. (3.9)."""
        xy = self.normalized(pixels)
        shape = (len(self), *(1,) * (xy.ndim - 2), 2)
        return xy * self.focal.reshape(shape) + self.center.reshape(shape)

    def directions(self, pixels: np.ndarray) -> np.ndarray:
        """Unit vectors in the world from the optical centres along the rays of pixels (n, ..., 2)."""
        xy = self.normalized(pixels).reshape(len(self), -1, 2)
        rays = np.concatenate([xy, np.ones_like(xy[..., :1])], -1) @ self.R_CW
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        return rays.reshape(*np.shape(pixels)[:-1], 3)

    @cached_property
    def _lens(self) -> tuple[np.ndarray, ...]:
        """k1, k2, k3, p1, p2 as columns (n, 1), against points in a row."""
        return tuple(np.hstack([self.radial, self.tangential]).T[:, :, None])

    def _normalized_from_world(self, p_W: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x, y and the depth in m, (n, points) each."""
        p_C = self.R_CW @ p_W.reshape(-1, 3).T + self.p_CW[:, :, None]
        z = np.where(p_C[:, 2] > 0.0, p_C[:, 2], np.nan)
        return p_C[:, 0] / z, p_C[:, 1] / z, z

    def _pixels(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        pixels = np.stack([x, y], -1)
        pixels *= self.focal[:, None]
        pixels += self.center[:, None]
        return pixels


def _distort(x, y, k1, k2, k3, p1, p2) -> tuple[np.ndarray, np.ndarray]:
    """Where the lens shows the normalised coordinates, Probst (2024) eq. (3.8) on these."""
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    across = 2.0 * (p1 * y + p2 * x)
    return x * (radial + across) + p2 * r2, y * (radial + across) + p1 * r2


def _distortion_jacobian(x, y, k1, k2, k3, p1, p2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The entries (x, x), (x, y) = (y, x) and (y, y) of the derivative of `_distort`."""
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2))  # of the radial factor by r2, twice
    a, b = p1 * y, p2 * x
    xx = radial + slope * x * x + 2.0 * a + 6.0 * b
    yy = radial + slope * y * y + 6.0 * a + 2.0 * b
    return xx, slope * x * y + 2.0 * (p1 * x + p2 * y), yy

"""Bundle adjustment of all cameras and all wand poses over all pixels and wand lengths.

A Levenberg-Marquardt step has 15 unknowns per camera and 6 per wand pose, thousands in all. Wand poses are
coupled only through the cameras, so they are eliminated (Schur complement) and the system that is solved has
the size of the cameras. Its inverse is their covariance. This structure is why the loop is written here:
`scipy.optimize.least_squares` would factor the whole sparse Jacobian at every step.
"""

from dataclasses import dataclass

import numpy as np

from robots.metrology.least_squares import UndeterminedError
from systems.vision.calibration.camera_parameters import (
    NUM,
    NUM_LENS,
    moved_cameras,
    project_with_parameters,
)
from systems.vision.camera_model import Cameras

_STEPS = 60  # of all; with a good first guess about ten suffice
_CONVERGED = 1e-9  # relative decrease of the sum of squares
_EXACT = 1e-12  # mean square of the residuals over what is expected: there is no noise
_LEAST_INFORMATION = 1e-14  # of a combination of parameters, relative to the best known one


@dataclass(frozen=True)
class Scene:
    """Observations of n cameras: k points at known positions, and the two ends of a wand in f poses.

    Pixels are NaN where a camera saw nothing.
    """

    known_points: np.ndarray  # m, (k, 3)
    known_pixels: np.ndarray  # (n, k, 2)
    wand_pixels: np.ndarray  # (n, f, 2, 2), the third axis is the end
    wand_length: float  # m
    wand_sigma: float = 1e-5  # m, standard deviation of the length as it is known
    pixel_sigma: float = 0.1  # px, expected along u and v of one exposure
    # Of how many exposures the pixels of the known points are the mean, (n, k); None for one.
    known_exposures: np.ndarray | None = None


@dataclass(frozen=True)
class Adjusted:
    """The maximum-likelihood cameras and wand poses."""

    cameras: Cameras
    wand: np.ndarray  # m, its ends, (f, 2, 3)
    covariance: np.ndarray  # of the parameters of each camera, (n, 15, 15), as the residuals scatter
    known_residual: np.ndarray  # px, seen minus expected, (n, k, 2)
    wand_residual: np.ndarray  # px, (n, f, 2, 2)
    sigma: float  # px, standard deviation of a pixel as the residuals show it
    steps: int
    converged: bool  # or the largest number of steps was not enough
    # m, of the wand as the known points have it, whatever it was given as; and its standard deviation
    known_wand_length: float
    known_wand_length_sigma: float


def adjust(cameras: Cameras, scene: Scene, wand_p_W: np.ndarray, with_lens: bool = True) -> Adjusted:
    """The minimum of Probst (2024) eq. (3.40) over all cameras and all ends of the wand.

    Args:
        cameras: where to begin, n of them.
        scene: what was seen.
        wand_p_W: where to begin with the wand in m, shape (f, 2, 3).
        with_lens: whether focal lengths, principal points and distortion are unknown too.

    Raises:
        UndeterminedError: if a parameter of a camera is left free, or the steps lead nowhere.
    """
    free = np.tile(np.arange(NUM) >= (0 if with_lens else NUM_LENS), len(cameras))
    damping, steps = 1e-3, 0
    now = _Linearized(cameras, scene, wand_p_W)
    converged = now.cost <= _EXACT * now.count
    if not np.isfinite(now.cost):
        raise UndeterminedError("the first guess of the cameras has points behind them")
    while not converged and steps < _STEPS:
        steps += 1
        change, shift = now.step(free, damping)
        then = _Linearized(moved_cameras(cameras, change), scene, wand_p_W + shift)
        if not then.cost < now.cost:
            converged = now.cost - then.cost > -_CONVERGED * now.cost  # rounding is all that is left
            damping *= 10.0
            if damping > 1e12:
                raise UndeterminedError("the adjustment of the cameras leads nowhere")
            continue
        gained, now = now.cost - then.cost, then
        cameras, wand_p_W = now.cameras, now.wand_p_W
        damping = max(0.1 * damping, 1e-12)
        converged = gained < _CONVERGED * now.cost or now.cost <= _EXACT * now.count
    freedom = now.count - free.sum() - 6 * len(wand_p_W)
    factor = np.sqrt(now.cost / freedom) if freedom > 0 else 1.0
    longer, longer_sigma = now.longer_wand(free)
    return Adjusted(
        now.cameras,
        now.wand_p_W,
        factor**2 * now.covariance(free),
        now.known_residual,
        now.wand_residual,
        float(factor * scene.pixel_sigma),
        steps,
        converged,
        scene.wand_length + longer,
        float(factor * longer_sigma),
    )


class _Linearized:
    """Whitened residuals and normal equations at one estimate."""

    def __init__(self, cameras: Cameras, scene: Scene, wand_p_W: np.ndarray) -> None:
        n, f = len(cameras), len(wand_p_W)
        self.cameras, self.wand_p_W = cameras, wand_p_W
        known, J_known, _ = project_with_parameters(cameras, scene.known_points)
        wand, J_wand, J_point = project_with_parameters(cameras, wand_p_W.reshape(-1, 3))
        seen = scene.wand_pixels.reshape(n, 2 * f, 2)
        self.known_residual = scene.known_pixels - known
        self.wand_residual = (seen - wand).reshape(n, f, 2, 2)
        lost = np.isnan(known) & ~np.isnan(scene.known_pixels), np.isnan(wand) & ~np.isnan(seen)
        averaged = np.ones(known.shape[:2]) if scene.known_exposures is None else scene.known_exposures
        known_sigma = scene.pixel_sigma / np.sqrt(np.maximum(averaged, 1))[..., None]
        r_known, J_known, _ = _weighted(self.known_residual, J_known, J_known, known_sigma)
        r_wand, J_wand, J_point = _weighted(seen - wand, J_wand, J_point, np.array([scene.pixel_sigma]))
        self._A = _gram(J_known) + _gram(J_wand)  # (n, 15, 15)
        self._a = _pull(J_known, r_known) + _pull(J_wand, r_wand)  # (n, 15)
        # (n, 15, 2 f, 3) to (15 n, f, 6): what cameras and places have to do with each other.
        both = (J_wand.swapaxes(-1, -2) @ J_point).swapaxes(1, 2)
        self._B = both.reshape(n * NUM, f, 6)
        blocks = np.einsum("nkij,nkil->kjl", J_point, J_point, optimize=True).reshape(f, 2, 3, 3)
        self._D = np.zeros((f, 6, 6))
        self._D[:, :3, :3], self._D[:, 3:, 3:] = blocks[:, 0], blocks[:, 1]
        self._d = np.einsum("nkij,nki->kj", J_point, r_wand, optimize=True).reshape(f, 6)
        span = wand_p_W[:, 1] - wand_p_W[:, 0]
        length = np.linalg.norm(span, axis=1, keepdims=True)
        pull = np.hstack([-span, span]) / length / scene.wand_sigma
        r_length = (scene.wand_length - length[:, 0]) / scene.wand_sigma
        self._pull, self._length_weight = pull, 1.0 / scene.wand_sigma
        self._r_length = r_length
        self._D += pull[:, :, None] * pull[:, None]
        self._d += pull * r_length[:, None]
        cost = np.sum(r_known**2) + np.sum(r_wand**2) + np.sum(r_length**2)
        self.cost = np.inf if lost[0].any() or lost[1].any() else float(cost)
        self.count = int(np.sum(~np.isnan(self.known_residual)) + np.sum(~np.isnan(self.wand_residual)) + f)

    def step(self, free: np.ndarray, damping: float) -> tuple[np.ndarray, np.ndarray]:
        """The damped step: changes of the parameters (n, 15) and shifts of the ends of the wand (f, 2, 3)."""
        n, f = self._a.shape[0], len(self._D)
        D_inverse = np.linalg.inv(self._D + damping * _diagonal(self._D))
        left = self._reduced(self._A + damping * _diagonal(self._A), D_inverse)
        right = self._a.ravel() - np.einsum("afi,fij,fj->a", self._B, D_inverse, self._d, optimize=True)
        change = np.zeros(n * NUM)
        try:
            change[free] = np.linalg.solve(left[np.ix_(free, free)], right[free])
        except np.linalg.LinAlgError as error:
            raise UndeterminedError("what was seen leaves parameters of the cameras free") from error
        shift = np.einsum("fij,fj->fi", D_inverse, self._d - np.einsum("afi,a->fi", self._B, change))
        return change.reshape(n, NUM), shift.reshape(f, 2, 3)

    def longer_wand(self, free: np.ndarray) -> tuple[float, float]:
        """By how much the wand is longer than given if that is unknown too, and its standard deviation, m.

        At a minimum for the given length: there one more unknown follows from its gradient alone.
        """
        D_inverse = np.linalg.inv(self._D)
        left = self._reduced(self._A, D_inverse)[np.ix_(free, free)]
        through = np.einsum("fij,fj->fi", D_inverse, self._length_weight * self._pull)
        cameras = np.einsum("afi,fi->a", self._B, through, optimize=True)[free]
        of_places = self._length_weight * np.einsum("fi,fi->", self._pull, through)
        information = len(self._D) * self._length_weight**2 - of_places
        information -= cameras @ np.linalg.solve(left, cameras)
        if not information > 0.0:  # no wand, or nothing but its length says how large everything is
            return 0.0, np.inf
        longer = -self._length_weight * self._r_length.sum() / information
        return float(longer), float(1.0 / np.sqrt(information))

    def covariance(self, free: np.ndarray) -> np.ndarray:
        """Of the parameters of each camera, (n, 15, 15); zero for those that are not free."""
        information = self._reduced(self._A, np.linalg.inv(self._D))[np.ix_(free, free)]
        scale = np.sqrt(np.diag(information))
        if not np.all(scale > 0.0):
            raise UndeterminedError("what was seen leaves parameters of the cameras free")
        scaled = information / np.outer(scale, scale)
        if not np.linalg.eigvalsh(scaled)[0] > _LEAST_INFORMATION:
            raise UndeterminedError("what was seen leaves parameters of the cameras free")
        n = len(self._a)
        whole = np.zeros((n * NUM, n * NUM))
        whole[np.ix_(free, free)] = np.linalg.inv(scaled) / np.outer(scale, scale)
        return whole.reshape(n, NUM, n, NUM)[np.arange(n), :, np.arange(n)]

    def _reduced(self, A: np.ndarray, D_inverse: np.ndarray) -> np.ndarray:
        """The Schur complement of the places of the wand, (15 n, 15 n)."""
        n, size = len(A), self._B.shape[0]
        through = (self._B.swapaxes(0, 1) @ D_inverse).swapaxes(0, 1).reshape(size, -1)
        left = -through @ self._B.reshape(size, -1).T
        blocks = left.reshape(n, NUM, n, NUM)
        blocks[np.arange(n), :, np.arange(n)] += A
        return left


def _weighted(
    residual: np.ndarray, J: np.ndarray, J_point: np.ndarray, sigma: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Over sigma (..., 1), and zero where nothing was seen."""
    seen = ~np.isnan(residual)
    return (
        np.where(seen, residual, 0.0) / sigma,
        np.where(seen[..., None], J, 0.0) / sigma[..., None],
        np.where(seen[..., None], J_point, 0.0) / sigma[..., None],
    )


def _gram(J: np.ndarray) -> np.ndarray:
    rows = J.reshape(len(J), -1, NUM)
    return rows.swapaxes(1, 2) @ rows


def _pull(J: np.ndarray, residual: np.ndarray) -> np.ndarray:
    return np.einsum("nri,nr->ni", J.reshape(len(J), -1, NUM), residual.reshape(len(J), -1))


def _diagonal(matrices: np.ndarray) -> np.ndarray:
    return matrices * np.eye(matrices.shape[-1])

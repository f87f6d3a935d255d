"""From what the cameras saw of wand and frame to where they stand and how they see.

A camera that sees the frame finds its place by it, with the lens that its data sheet promises. What two of
them see of the wand is triangulated, and a camera that does not see the frame finds its place by the wand
(direct linear transformation). Then everything is adjusted together, first the places, then the lenses;
pixels that do not belong to the rest are left out, and it is adjusted again.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from robots.calibration.least_squares import UndeterminedError
from systems.tracking.calibration.bundle_adjustment import Adjusted, Scene, adjust
from systems.tracking.calibration.direct_linear import camera_from_projection, direct_linear
from systems.tracking.calibration.wand import CalibrationKit, WandRun
from systems.tracking.camera_model import Cameras
from systems.tracking.triangulation import triangulate

MINIMUM_FRAME_POINTS = 4
MINIMUM_WAND_POINTS = 30  # in a camera: twice what its fifteen parameters take, and twice that again
MINIMUM_PLACES = 20

_OUTLIER = 5.0  # sigma
_ROUNDS = 6  # of leaving out
_WRONG_PLACE = 50.0  # px, a camera that is so far off in the middle is placed anew


@dataclass(frozen=True)
class WandCalibration:
    """The cameras in the frame Q of the L-frame, and how well they are known."""

    cameras: Cameras
    covariance: np.ndarray  # of the parameters `camera_parameters.NAMES` of each camera, (n, 15, 15)
    sigma: float  # px, standard deviation of a pixel as the residuals show it
    points: np.ndarray  # of the wand that each camera saw and that were used, (n,)
    outliers: np.ndarray  # pixels that were left out, (n,)
    rms_px: np.ndarray  # root mean square distance of seen and expected pixels, (n,)
    mean_distance: np.ndarray  # m, from the point to the ray on average, Probst (2024) figure A.10, (n,)
    wand_lengths: np.ndarray  # m, of each place, by triangulation alone, (f,)
    wand: np.ndarray  # m, its ends, (f, 2, 3)

    @property
    def position_sigma(self) -> np.ndarray:
        """Standard deviation of the places of the cameras along an axis on average in m, (n,)."""
        return np.sqrt(np.einsum("nii->n", self.covariance[:, 12:, 12:]) / 3.0)

    @property
    def wand_deviation(self) -> float:
        """Standard deviation of the wand's length in m."""
        return float(np.std(self.wand_lengths, ddof=1))


def calibrate_with_wand(
    run: WandRun, kit: CalibrationKit, guess: Cameras, names: list[str], pixel_sigma: float = 0.1
) -> WandCalibration:
    """The most likely cameras.

    Args:
        run: what n cameras saw.
        kit: wand and frame.
        guess: the lenses of the n cameras as their data sheets say; poses are not looked at.
        names: of the cameras, for refusals.
        pixel_sigma: px, expected along u and v.

    Raises:
        UndeterminedError: if cameras or points are too few, or do not determine what is asked of them.
    """
    seen = ~np.isnan(run.wand_pixels[..., 0])  # (n, f, 2)
    _refuse_too_little(run, seen, names)
    # A place of the wand serves if two cameras saw each end of it.
    places = np.flatnonzero(np.all(seen.sum(0) >= 2, axis=1))
    if len(places) < MINIMUM_PLACES:
        raise UndeterminedError(
            f"wand: two cameras saw both ends in {len(places)} places, needs {MINIMUM_PLACES}"
        )
    pixels = run.wand_pixels[:, places]
    scene = Scene(
        kit.p_Q,
        run.frame_pixels,
        pixels,
        1e-3 * kit.wand_length_mm,
        1e-3 * kit.wand_sigma_mm,
        pixel_sigma,
    )
    cameras = _placed(guess, scene, names)
    wand = _triangulated(cameras, pixels, pixel_sigma)
    cameras = adjust(cameras, _within(scene, wand), wand[_whole(wand)], with_lens=False).cameras
    return _report(*_adjusted(cameras, scene), run)


def _refuse_too_little(run: WandRun, seen: np.ndarray, names: list[str]) -> None:
    if len(names) < 2:
        raise UndeterminedError(f"wand: needs at least two cameras, got {len(names)}")
    on_frame = np.sum(~np.isnan(run.frame_pixels[..., 0]), axis=1)
    if np.sum(on_frame >= MINIMUM_FRAME_POINTS) < 2:
        raise UndeterminedError(
            f"frame: two cameras must see {MINIMUM_FRAME_POINTS} points of it, "
            f"{np.sum(on_frame >= MINIMUM_FRAME_POINTS)} did"
        )
    for name, count in zip(names, seen.sum((1, 2)), strict=True):
        if count < MINIMUM_WAND_POINTS:
            raise UndeterminedError(
                f"camera {name}: saw {count} points of the wand, needs {MINIMUM_WAND_POINTS}"
            )


def _placed(guess: Cameras, scene: Scene, names: list[str]) -> Cameras:
    """First guesses of where the cameras are."""
    n = len(guess)
    placed: list[Cameras | None] = [_by_frame(guess.subset([i]), scene, i) for i in range(n)]
    for _ in range(n):
        known = [i for i in range(n) if placed[i] is not None]
        together = _joined([camera for camera in placed if camera is not None])
        wand = _triangulated(together, scene.wand_pixels[known], scene.pixel_sigma).reshape(-1, 3)
        for i in range(n):
            pixels = scene.wand_pixels[i].reshape(-1, 2)
            both = ~np.isnan(pixels[:, 0] + wand[:, 0])
            camera = placed[i]
            if camera is not None:
                off = np.linalg.norm(camera.project(wand[both])[0] - pixels[both], axis=-1)
                if np.nanmedian(off) < _WRONG_PLACE:
                    continue
            if both.sum() >= MINIMUM_WAND_POINTS:
                placed[i] = camera_from_projection(direct_linear(wand[both], pixels[both]), wand[both])
        if all(camera is not None for camera in placed):
            break
    for name, camera in zip(names, placed, strict=True):
        if camera is None:
            raise UndeterminedError(
                f"camera {name}: saw neither {MINIMUM_FRAME_POINTS} points of the frame nor enough of the "
                "wand together with two others that did"
            )
    return _joined([camera for camera in placed if camera is not None])


def _by_frame(camera: Cameras, scene: Scene, i: int) -> Cameras | None:
    """Where a camera with a known lens stands that sees the frame; None if it does not."""
    seen = ~np.isnan(scene.known_pixels[i, :, 0])
    if seen.sum() < MINIMUM_FRAME_POINTS:
        return None
    lens = np.array([*camera.radial[0, :2], *camera.tangential[0], camera.radial[0, 2]])
    points, pixels = scene.known_points[seen], scene.known_pixels[i, seen]
    found, turn, p_CQ = cv2.solvePnP(points, pixels, camera.intrinsics[0], lens, flags=cv2.SOLVEPNP_SQPNP)
    if not found:
        return None
    R_CQ = cv2.Rodrigues(turn)[0]
    return replace(camera, R_WC=R_CQ.T[None], p_WC=(-R_CQ.T @ p_CQ).T)


def _joined(cameras: list[Cameras]) -> Cameras:
    names = Cameras.__dataclass_fields__
    return Cameras(*(np.concatenate([getattr(camera, name) for camera in cameras]) for name in names))


def _triangulated(cameras: Cameras, pixels: np.ndarray, sigma: float) -> np.ndarray:
    """Ends of the wand in m, (f, 2, 3), NaN where fewer than two cameras saw one."""
    n, f = pixels.shape[:2]
    return triangulate(cameras, pixels.reshape(n, 2 * f, 2), sigma).p_W.reshape(f, 2, 3)


def _whole(wand: np.ndarray) -> np.ndarray:
    """Which places of the wand have both ends."""
    return np.isfinite(wand.reshape(len(wand), 6).sum(1))


def _within(scene: Scene, wand: np.ndarray) -> Scene:
    return replace(scene, wand_pixels=scene.wand_pixels[:, _whole(wand)])


def _adjusted(cameras: Cameras, scene: Scene) -> tuple[Adjusted, Scene]:
    """Adjusts, leaves out what does not belong to the rest, and adjusts again until nothing is left out."""
    found = None
    for _ in range(_ROUNDS):
        wand = _triangulated(cameras, scene.wand_pixels, scene.pixel_sigma)
        scene = _within(scene, wand)
        found = adjust(cameras, scene, wand[_whole(wand)])
        cameras = found.cameras
        typical = 1.4826 * np.nanmedian(np.abs(found.wand_residual))  # outliers do not move the median
        off = np.nan_to_num(np.abs(found.wand_residual).max(-1))
        # The worst camera of a point first: it has drawn the point away from the others.
        wrong = (off > _OUTLIER * max(typical, 1e-9)) & (off == off.max(0))
        if not wrong.any():
            break
        scene = replace(scene, wand_pixels=np.where(wrong[..., None], np.nan, scene.wand_pixels))
    assert found is not None
    return found, scene


def _report(found: Adjusted, scene: Scene, run: WandRun) -> WandCalibration:
    cameras, (n, f) = found.cameras, found.wand_residual.shape[:2]
    off = np.linalg.norm(found.wand_residual, axis=-1).reshape(n, 2 * f)
    used = ~np.isnan(scene.wand_pixels[..., 0])
    points = used.sum((1, 2))
    # A pixel off is an angle off, and that is a length at the point's depth.
    p_Q = found.wand.reshape(-1, 3)
    distance = np.linalg.norm(found.wand_residual.reshape(n, 2 * f, 2) / cameras.focal[:, None], axis=-1)
    ends = _triangulated(cameras, scene.wand_pixels, scene.pixel_sigma)
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    return WandCalibration(
        cameras,
        found.covariance,
        found.sigma,
        points,
        np.sum(~np.isnan(run.wand_pixels[..., 0]), axis=(1, 2)) - points,
        np.sqrt(np.nanmean(off**2, axis=1)),
        np.nanmean(distance * cameras.depth(p_Q), axis=1),
        lengths[~np.isnan(lengths)],
        found.wand,
    )

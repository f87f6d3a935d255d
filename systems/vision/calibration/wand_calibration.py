"""Calibration of poses and lenses of all cameras from observations of wand and L-frame.

The cameras are located one by one (`camera_placement`), then everything is adjusted together
(`bundle_adjustment`), first the poses, then the lenses; outliers are removed and the adjustment is repeated.
"""

from dataclasses import dataclass, replace

import numpy as np

from robots.metrology.least_squares import UndeterminedError
from systems.vision.calibration.bundle_adjustment import Adjusted, Scene, adjust
from systems.vision.calibration.camera_placement import (
    MINIMUM_FRAME_POINTS,
    MINIMUM_WAND_POINTS,
    placed_cameras,
    triangulated_wand,
)
from systems.vision.calibration.wand import CalibrationKit, WandRun
from systems.vision.camera_model import Cameras

MINIMUM_PLACES = 20

_OUTLIER = 5.0  # sigma
_ROUNDS = 8  # of leaving out
# The frame tells the wand's length as well as data sheets tell the lenses: to a percent, at worst to a third.
_WRONG_SCALE = 1.6
_FRAME_OFF = 5.0  # times what is expected of the frame's pixels: its lengths contradict that of the wand
_DOUBT = 4.0  # sigma, beyond which the frame's length of the wand is another one: once in 16 000
# A lens is as its data sheet says within less, and the middle of its image within less of the size.
_OTHER_RESOLUTION = 0.15
_SAME_FACTOR = 0.05  # by which the factors of focal length and middle may differ then
_LARGEST_SIGMA = 3.0  # px; no camera is that bad, so points have wrong names or a lens is another one


@dataclass(frozen=True)
class WandCalibration:
    """The calibrated cameras in the L-frame Q, with covariances and residuals."""

    cameras: Cameras
    covariance: np.ndarray  # of the parameters `camera_parameters.NAMES` of each camera, (n, 15, 15)
    sigma: float  # px, standard deviation of a pixel as the residuals show it
    points: np.ndarray  # of the wand that each camera saw and that were used, (n,)
    outliers: np.ndarray  # pixels that contradict the other cameras and were left out, (n,)
    unused: np.ndarray  # pixels of places of the wand of which two cameras did not see both ends, (n,)
    rms_px: np.ndarray  # root mean square distance of seen and expected pixels, (n,)
    mean_distance: np.ndarray  # m, from the point to the ray on average, Probst (2024) figure A.10, (n,)
    wand_lengths: np.ndarray  # m, of each place, by triangulation alone, (f,)
    wand: np.ndarray  # m, its ends, (f, 2, 3)
    # m, of the wand in the scale of the L-frame, whatever length it was given; and the standard deviation
    # that follows from the pixels and from how well the frame is made
    wand_by_frame: float
    wand_by_frame_sigma: float
    contradicts_frame: bool  # whether that is another length than the given one, beyond doubt

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
    """Estimates poses and lenses of all cameras (maximum likelihood).

    Args:
        run: what n cameras saw.
        kit: wand and frame.
        guess: the lenses of the n cameras as their data sheets say; of poses it counts alone whether the
            cameras are below the frame.
        names: of the cameras, for refusals.
        pixel_sigma: px, expected along u and v.

    Raises:
        UndeterminedError: if cameras or points are too few, do not determine what is asked of them, show
            another ratio of wand and frame than the kit has, or a mirror image of the cell.
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
        run.frame_exposures,
    )
    cameras = placed_cameras(guess, scene, names)
    _refuse_wrong_scale(cameras, scene)
    everything = ~np.isnan(pixels[..., 0])
    cameras = _once(cameras, scene, everything, with_lens=False)[0].cameras
    _refuse_mirrored(cameras, guess, kit)
    found, used, outliers = _adjusted(cameras, scene, names)
    if found.sigma > _LARGEST_SIGMA:
        raise UndeterminedError(
            f"wand: pixels scatter by {found.sigma:.1f} px, {pixel_sigma:g} px are expected: are ends or "
            "points exchanged, or lengths or lenses not those of the kit and the cell?"
        )
    if not found.converged:
        raise UndeterminedError(f"wand: the adjustment did not converge in {found.steps} steps")
    _refuse_contradicting_frame(found, scene)
    _refuse_other_resolution(found.cameras, guess)
    return _report(found, used, outliers, run, kit)


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
                f"camera {name}: saw {count} points of the wand, needs {MINIMUM_WAND_POINTS}: carry it "
                "through more places before it"
            )


def _refuse_wrong_scale(cameras: Cameras, scene: Scene) -> None:
    """Refuses a wand that has another length, seen by cameras that the frame has placed."""
    ends = triangulated_wand(cameras, scene.wand_pixels, scene.pixel_sigma)
    length = float(np.nanmedian(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))
    if not 1.0 / _WRONG_SCALE < scene.wand_length / length < _WRONG_SCALE:
        raise UndeterminedError(
            f"wand: its length is given as {1e3 * scene.wand_length:g} mm, but by the scale of the L-frame "
            f"it is about {1e3 * length:.0f} mm; is the unit right (mm), and is it the wand of this kit?"
        )


def _refuse_mirrored(cameras: Cameras, guess: Cameras, kit: CalibrationKit) -> None:
    """Refuses cameras below the floor: a flat frame looks the same from there in mirrored images."""
    height = kit.p_Q[:, 2]
    is_flat = np.ptp(height) == 0.0
    if is_flat and (cameras.p_WC[:, 2] < height[0]).all() and (guess.p_WC[:, 2] > height[0]).any():
        raise UndeterminedError(
            "frame: all cameras come out below it, as in a mirror image of the cell: are u and v exchanged?"
        )


def _refuse_contradicting_frame(found: Adjusted, scene: Scene) -> None:
    """Refuses a frame that is not where it was seen, in the scale of the wand."""
    exposures = np.ones(found.known_residual.shape[:2])
    if scene.known_exposures is not None:
        exposures = np.maximum(scene.known_exposures, 1)
    off = np.sqrt(np.nanmean(exposures[..., None] * found.known_residual**2))
    if off > _FRAME_OFF * scene.pixel_sigma:
        raise UndeterminedError(
            f"frame: its points are {off / scene.pixel_sigma:.0f} times as far from where the wand puts them "
            f"as pixels that scatter by {scene.pixel_sigma:g} px allow; is the length of the wand, "
            f"{1e3 * scene.wand_length:g} mm, that of the wand that was used?"
        )


def _refuse_other_resolution(cameras: Cameras, guess: Cameras) -> None:
    """Refuses images of another resolution, in which all of a camera is larger or smaller by one factor."""
    focal = float(np.median(cameras.focal / guess.focal))
    middle = float(np.median(cameras.center / guess.center))
    if abs(focal - 1.0) > _OTHER_RESOLUTION and abs(middle / focal - 1.0) < _SAME_FACTOR:
        raise UndeterminedError(
            f"cameras: focal lengths and principal points in px come out {focal:.2g} times those of the "
            f"cell: are the images of {focal:.2g} times the resolution of its sensor_px?"
        )


def _refuse_contradiction(seen: np.ndarray, used: np.ndarray, names: list[str]) -> None:
    """Refuses a camera of whose points, (n, f, 2), hardly any belong to the rest."""
    for name, there, left in zip(names, seen.sum((1, 2)), used.sum((1, 2)), strict=True):
        if left < MINIMUM_WAND_POINTS:
            raise UndeterminedError(
                f"camera {name}: {there - left} of its {there} points contradict the other cameras: are the "
                "ends of the wand exchanged?"
            )


def _adjusted(cameras: Cameras, scene: Scene, names: list[str]) -> tuple[Adjusted, Scene, np.ndarray]:
    """Adjusts and removes outliers in turn until the set of inliers no longer changes.

    Returns:
        What was found, the scene with what was used of it, and how many outliers each camera has, (n,).
    """
    seen_at_all = ~np.isnan(scene.wand_pixels[..., 0])
    used = seen_at_all
    found, some, whole = _once(cameras, scene, used)
    for _ in range(_ROUNDS):
        cameras = found.cameras
        typical = 1.4826 * np.nanmedian(np.abs(found.wand_residual))  # outliers do not move the median
        seen = scene.wand_pixels[:, whole]
        off = np.nan_to_num(np.abs(seen - cameras.project(found.wand)).max(-1))
        far = off > _OUTLIER * max(typical, 1e-9)
        # Of a point's pixels the worst goes first: it has drawn the point away from the others.
        worst = off == np.where(used[:, whole], off, 0.0).max(0)
        now = used.copy()
        now[:, whole] = ~np.isnan(seen[..., 0]) & ~(far & (worst | ~used[:, whole]))
        if np.array_equal(now, used):
            break
        used = now
        _refuse_contradiction(~np.isnan(scene.wand_pixels[..., 0]), used, names)
        found, some, whole = _once(cameras, scene, used)
    return found, some, np.sum(seen_at_all & ~used, axis=(1, 2))


def _once(
    cameras: Cameras, scene: Scene, used: np.ndarray, with_lens: bool = True
) -> tuple[Adjusted, Scene, np.ndarray]:
    """Adjusts with some pixels; also the scene with only these, and which places of the wand it has."""
    pixels = np.where(used[..., None], scene.wand_pixels, np.nan)
    wand = triangulated_wand(cameras, pixels, scene.pixel_sigma)
    whole = np.isfinite(wand.reshape(len(wand), 6).sum(1))
    some = replace(scene, wand_pixels=pixels[:, whole])
    return adjust(cameras, some, wand[whole], with_lens), some, np.flatnonzero(whole)


def _report(
    found: Adjusted, scene: Scene, outliers: np.ndarray, run: WandRun, kit: CalibrationKit
) -> WandCalibration:
    cameras, (n, f) = found.cameras, found.wand_residual.shape[:2]
    off = np.linalg.norm(found.wand_residual, axis=-1).reshape(n, 2 * f)
    used = ~np.isnan(scene.wand_pixels[..., 0])
    points = used.sum((1, 2))
    # A pixel off is an angle off, and that is a length at the point's depth.
    p_Q = found.wand.reshape(-1, 3)
    distance = np.linalg.norm(found.wand_residual.reshape(n, 2 * f, 2) / cameras.focal[:, None], axis=-1)
    ends = triangulated_wand(cameras, scene.wand_pixels, scene.pixel_sigma)
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    of_frame = scene.wand_length * kit.frame_scale_sigma
    by_frame_sigma = float(np.hypot(found.known_wand_length_sigma, of_frame))
    return WandCalibration(
        cameras,
        found.covariance,
        found.sigma,
        points,
        outliers,
        np.sum(~np.isnan(run.wand_pixels[..., 0]), axis=(1, 2)) - points - outliers,
        np.sqrt(np.nanmean(off**2, axis=1)),
        np.nanmean(distance * cameras.depth(p_Q), axis=1),
        lengths[~np.isnan(lengths)],
        found.wand,
        found.known_wand_length,
        by_frame_sigma,
        abs(found.known_wand_length - scene.wand_length) > _DOUBT * by_frame_sigma,
    )

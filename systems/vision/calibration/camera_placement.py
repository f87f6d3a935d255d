"""Initial camera poses for the calibration.

A camera that sees the L-frame is located by it, with the lens parameters of its data sheet. Wand ends seen
by two located cameras are triangulated, and a camera that does not see the frame, or was located at the
mirrored solution, is located by the wand (direct linear transformation).
"""

from dataclasses import replace

import cv2
import numpy as np

from robots.metrology.least_squares import UndeterminedError
from systems.vision.calibration.bundle_adjustment import Scene
from systems.vision.calibration.direct_linear import camera_from_projection, direct_linear
from systems.vision.camera_model import Cameras
from systems.vision.triangulation import triangulate

MINIMUM_FRAME_POINTS = 4
MINIMUM_WAND_POINTS = 30  # in a camera, whose fifteen parameters take eight

_WRONG_PLACE = 50.0  # px, a camera that is so far off in the middle is placed anew


def placed_cameras(guess: Cameras, scene: Scene, names: list[str]) -> Cameras:
    """The cameras of a scene with first guesses of their poses.

    Args:
        guess: their lenses; poses are not looked at.
        scene: what they saw, two of them at least all of the frame.
        names: for refusals.

    Raises:
        UndeterminedError: if there is no place for a camera.
    """
    n = len(guess)
    placed: list[Cameras | None] = [_by_frame(guess.subset([i]), scene, i) for i in range(n)]
    for _ in range(n):
        known = [i for i in range(n) if placed[i] is not None]
        together = _joined([camera for camera in placed if camera is not None])
        wand = triangulated_wand(together, scene.wand_pixels[known], scene.pixel_sigma).reshape(-1, 3)
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


def triangulated_wand(cameras: Cameras, pixels: np.ndarray, sigma: float) -> np.ndarray:
    """Ends of the wand in m, (f, 2, 3), NaN where fewer than two cameras saw one."""
    n, f = pixels.shape[:2]
    return triangulate(cameras, pixels.reshape(n, 2 * f, 2), sigma).p_W.reshape(f, 2, 3)

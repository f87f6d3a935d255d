"""One camera from known points, Probst (2024) section 3.1.7: direct linear transformation, then the lens."""

from dataclasses import dataclass

import numpy as np

from robots.metrology.least_squares import UndeterminedError
from systems.vision.calibration.bundle_adjustment import Scene, adjust
from systems.vision.calibration.camera_parameters import NUM
from systems.vision.calibration.direct_linear import camera_from_projection, direct_linear
from systems.vision.camera_model import Cameras

MINIMUM_POINTS = (NUM + 1) // 2  # two numbers each


@dataclass(frozen=True)
class CalibratedCamera:
    """One calibrated camera with its covariance; the parameters are those of `camera_parameters.NAMES`."""

    camera: Cameras  # of length one
    covariance: np.ndarray  # (15, 15), as the residuals scatter
    residual: np.ndarray  # px, seen minus expected, (k, 2)

    @property
    def rms(self) -> float:
        """Root mean square of the distances in px, as OpenCV's ``calibrateCamera`` returns it."""
        return float(np.sqrt(np.nanmean(np.sum(self.residual**2, axis=-1))))


def calibrate_from_points(p_W: np.ndarray, pixels: np.ndarray) -> CalibratedCamera:
    """Lens and pose of a camera, Probst (2024) eqs. (3.31) to (3.40).

    The distorted pixels are good enough for a first guess by the linear model.

    Args:
        p_W: points in m, shape (k, 3).
        pixels: where the camera sees them, shape (k, 2); NaN where it does not.

    Raises:
        UndeterminedError: if points are too few, lie in a plane, or do not determine the lens.
    """
    seen = ~np.isnan(pixels[:, 0])
    if seen.sum() < MINIMUM_POINTS:
        raise UndeterminedError(
            f"a camera with its lens takes at least {MINIMUM_POINTS} known points, got {seen.sum()}"
        )
    guess = camera_from_projection(direct_linear(p_W[seen], pixels[seen]), p_W[seen])
    scene = Scene(p_W[seen], pixels[None, seen], np.empty((1, 0, 2, 2)), wand_length=1.0)
    found = adjust(guess, scene, np.empty((0, 2, 3)))
    residual = np.full((len(p_W), 2), np.nan)
    residual[seen] = found.known_residual[0]
    return CalibratedCamera(found.cameras, found.covariance[0], residual)

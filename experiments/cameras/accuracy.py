"""Achievable pose accuracy, from the geometry of cameras and markers and from the image quality.

The bound is that of Cramer and Rao, sigma^2 (J^T J)^-1 over all blobs that are seen: markers that touch each
other in an image are one blob there. The tracker reaches it within a few percent
(`experiments.bench.tracking`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagrams.runs.start import start_position
from diagrams.scenario.controller_model import controller_model
from diagrams.scenario.scenario import Scenario
from robots.description.model import RobotModel
from robots.dynamics.newton_inverse import inverse_kinematics
from robots.kinematics.arm_capsules import ArmCapsules
from robots.kinematics.forward import Kinematics
from robots.measurement_design.constraints import AdmissibleConfigurations
from systems.cell.imaging.images import ImageConfig, ImageSource
from systems.reference.paths import CartesianPath
from systems.vision.blobs.centroids import CentroidConfig, blobs_in
from systems.vision.camera_model import Cameras
from systems.vision.marker_body import DetectionBody
from systems.vision.tracking.marker_images import image_shares, marker_diameters, touching
from systems.vision.tracking.pose_refinement import linearize, shared
from systems.vision.visibility import in_window, occluded

_LEAST_INFORMATION = 1.0  # px^2 per m^2 or rad^2, as in `systems.vision.tracking.pose_refinement`
_LONE = 1.1, 3.0  # diameters, and px beside, that a marker must be away from the next one to stand alone
_NEAR = 0.25  # diameters, within which a blob is the one of a marker


@dataclass(frozen=True)
class Places:
    """Tool poses at which accuracy is evaluated, with the arm configuration at each."""

    X_WE: np.ndarray  # (p, 4, 4)
    q: np.ndarray  # rad, (p, 6)


def places_on_path(scenario: Scenario, robot: RobotModel, path: CartesianPath, count: int) -> Places:
    """Evenly in time from the start of a path to its end."""
    X_WE = path.sample(np.linspace(path.path_start, path.dwell_start, count))[0]
    q = start_position(controller_model(scenario, robot), scenario, path)
    inverse = inverse_kinematics(robot)
    joints = []
    for X in X_WE:
        q = inverse.nearest(X, q)
        joints.append(q)
    return Places(X_WE, np.array(joints))


def places_in_workspace(robot: RobotModel, count: int, seed: int) -> Places:
    """Random configurations of the arm that touch neither the floor nor its base."""
    rng, admissible = np.random.default_rng(seed), AdmissibleConfigurations(robot)
    q = np.empty((0, len(robot.lower)))
    while len(q) < count:
        guess = rng.uniform(robot.lower, robot.upper, (count, len(robot.lower)))
        q = np.vstack([q, guess[admissible(guess)]])[:count]
    return Places(Kinematics(robot).forward(q), q)


def information(
    cameras: Cameras, windows: np.ndarray, body: DetectionBody, places: Places, robot: RobotModel
) -> np.ndarray:
    """What each camera says of each pose for pixels with a standard deviation of 1 px, (p, n, 6, 6).

    Markers count that are in their windows and not behind the arm; those that touch each other are one.
    """
    arm, rows = ArmCapsules(robot), []
    for X, q in zip(places.X_WE, places.q, strict=True):
        pixels, J = linearize(cameras, body.p_E, X)
        p_W = body.p_E @ X[:3, :3].T + X[:3, 3]
        seen = in_window(pixels, windows) & ~occluded(cameras.p_WC, p_W, arm.at(q))
        size = marker_diameters(cameras, body, p_W)
        share = image_shares(touching(pixels, size), seen, size)
        J = np.nan_to_num(shared(J, share)).reshape(len(cameras), -1, 6)
        rows.append(J.swapaxes(1, 2) @ J)
    return np.array(rows)


def pose_covariance(information: np.ndarray, pixel_sigma: float) -> np.ndarray:
    """The bound of the covariance (rad, m) from the information (..., 6, 6); NaN where a pose is not seen."""
    least = np.linalg.eigvalsh(information)[..., 0]
    seen = least > _LEAST_INFORMATION
    safe = np.where(seen[..., None, None], information, np.eye(6))
    return np.where(seen[..., None, None], pixel_sigma**2 * np.linalg.inv(safe), np.nan)


@dataclass(frozen=True)
class Accuracy:
    """Standard deviations over many poses; along and about an axis on average."""

    position: float  # m, median
    worst_position: float  # m, exceeded by a tenth of the poses
    rotation: float  # rad, median
    seen: float  # share of the poses that can be measured

    def as_dict(self) -> dict[str, float | None]:
        """In um, millidegrees and percent; None where nothing is seen."""
        if self.seen == 0.0:
            return {"position_um": None, "position_90_um": None, "rotation_mdeg": None, "seen_percent": 0.0}
        return {
            "position_um": 1e6 * self.position,
            "position_90_um": 1e6 * self.worst_position,
            "rotation_mdeg": 1e3 * float(np.rad2deg(self.rotation)),
            "seen_percent": 100.0 * self.seen,
        }


def accuracy(covariance: np.ndarray) -> Accuracy:
    """Of poses with covariances (p, 6, 6), NaN where a pose is not seen."""
    variances = np.diagonal(covariance, axis1=1, axis2=2)
    seen = np.isfinite(variances[:, 0])
    if not seen.any():
        return Accuracy(np.nan, np.nan, np.nan, 0.0)
    rotation, position = np.sqrt(variances[seen, :3].mean(1)), np.sqrt(variances[seen, 3:].mean(1))
    return Accuracy(
        float(np.median(position)),
        float(np.quantile(position, 0.9)),
        float(np.median(rotation)),
        float(seen.mean()),
    )


def centroid_sigma(
    cameras: Cameras,
    windows: np.ndarray,
    body: DetectionBody,
    images: ImageConfig,
    X_WE: Sequence[np.ndarray],
    speed: float,
    seed: int,
) -> tuple[float, float]:
    """How exactly markers are found in images, by taking some.

    Args:
        cameras: n cameras.
        windows: of their images, (n, 4).
        body: with the markers.
        images: how light is recorded.
        X_WE: poses of the tool, (4, 4) each.
        speed: of the tool in m/s, in random directions.
        seed: of noise and directions.

    Returns:
        Root mean square error along u and v in px, and the share of the markers that were found, of those
        that stand alone.
    """
    centroids, rng = CentroidConfig(), np.random.default_rng(seed)
    source = ImageSource(cameras, windows, body, images, centroids.threshold)
    errors, total = [], 0
    for X in X_WE:
        direction = rng.standard_normal(3)
        V = np.concatenate([np.zeros(3), speed * direction / np.linalg.norm(direction)])
        pictures = source.expose(X, V, rng.standard_normal(2), source.windows(X))
        error, alone = centroid_errors(cameras, windows, body, X, blobs_in(pictures, cameras, centroids))
        errors.append(error)
        total += alone
    found = np.concatenate(errors)
    rms = float(np.sqrt(np.mean(found**2))) if len(found) else float("nan")
    return rms, len(found) / max(total, 1)


def centroid_errors(
    cameras: Cameras, windows: np.ndarray, body: DetectionBody, X_WE: np.ndarray, blobs: np.ndarray
) -> tuple[np.ndarray, int]:
    """Errors in px of the blobs (n, b, 2) of markers that stand alone, (k, 2), and how many do."""
    p_W = body.p_E @ X_WE[:3, :3].T + X_WE[:3, 3]
    true, size = cameras.project(p_W), marker_diameters(cameras, body, p_W)
    factor, beside = _LONE
    alone = in_window(true, windows + size.max() * np.array([1.0, 1.0, -1.0, -1.0]))
    alone &= ~touching(true, factor * size + beside).any(2)
    offset = blobs[:, None] - true[:, :, None]
    distance = np.nan_to_num(np.linalg.norm(offset, axis=-1), nan=np.inf)
    nearest = np.take_along_axis(offset, distance.argmin(2)[..., None, None], 2)[:, :, 0]
    return nearest[alone & (distance.min(2) < _NEAR * size)], int(alone.sum())

"""Sensitivity of the pose accuracy: one parameter of the camera system is varied at a time.

Geometry is judged by the Cramer-Rao bound over the test path and over the workspace. Where sharpness, light
or size of the markers change, pictures are taken first and the bound is scaled with the error of their
centroids.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from experiments.cameras.accuracy import (
    Accuracy,
    Places,
    accuracy,
    centroid_sigma,
    information,
    pose_covariance,
)
from experiments.cameras.variations import best_subsets, ring, with_markers, with_resolution, with_size
from experiments.cli.workers import Executor, Progress, in_order
from robots.description.model import RobotModel
from systems.cell.imaging.images import ImageConfig
from systems.vision.camera_model import Cameras
from systems.vision.camera_rig import MeasuringCell
from systems.vision.marker_body import DetectionBody

RING_CAMERAS, RING_RADIUS, RING_HEIGHT = 8, 4.0, 2.0  # m
PICTURED = 12  # poses of which pictures are taken


@dataclass(frozen=True)
class SweepSetup:
    """Poses, cameras and noise of a sweep."""

    cell: MeasuringCell
    body: DetectionBody
    robot: RobotModel
    path: Places
    workspace: Places
    pixel_sigma: float  # px, of features
    images: ImageConfig
    speed: float  # m/s, of the tool where pictures are taken
    seed: int


@dataclass(frozen=True)
class SweepPoint:
    """One value of the varied parameter and the resulting accuracy."""

    value: float
    path: Accuracy
    workspace: Accuracy
    pixel_sigma: float  # px, given, or measured in images
    found: float = 1.0  # share of the lone markers that were found in images
    cameras: tuple[str, ...] = ()  # their names, where it is about which ones

    def as_dict(self) -> dict[str, Any]:
        """In the units of `Accuracy.as_dict`."""
        return {
            "value": self.value,
            "path": self.path.as_dict(),
            "workspace": self.workspace.as_dict(),
            "pixel_sigma": self.pixel_sigma if np.isfinite(self.pixel_sigma) else None,
            "found_percent": 100.0 * self.found,
            **({"cameras": list(self.cameras)} if self.cameras else {}),
        }


@dataclass(frozen=True)
class _Job:
    setup: SweepSetup
    sweep: str
    value: float


def study_sweeps(
    setup: SweepSetup, executor: Executor, progress: Progress | None = None
) -> dict[str, list[SweepPoint]]:
    """All sweeps, by the names of `SWEEPS`."""
    jobs = [_Job(setup, name, value) for name, sweep in SWEEPS.items() for value in sweep.values]
    points = in_order(executor, _study, jobs, progress)
    found: dict[str, list[SweepPoint]] = {name: [] for name in SWEEPS}
    for job, point in zip(jobs, points, strict=True):
        if all(point.value != other.value for other in found[job.sweep]):  # there are no more than there are
            found[job.sweep].append(point)
    return found


def _study(job: _Job, progress: Progress) -> SweepPoint:
    point = SWEEPS[job.sweep].study(job.setup, job.value)
    progress(1.0)
    return point


def _judged(
    setup: SweepSetup,
    value: float,
    cameras: Cameras,
    windows: np.ndarray,
    body: DetectionBody,
    pixel_sigma: float,
    found: float = 1.0,
) -> SweepPoint:
    """By the bound, over path and workspace; a share of the markers that is not found says nothing."""
    path, workspace = (
        accuracy(pose_covariance(found * known.sum(1), pixel_sigma))
        for known in (
            information(cameras, windows, body, places, setup.robot)
            for places in (setup.path, setup.workspace)
        )
    )
    return SweepPoint(value, path, workspace, pixel_sigma, found)


def _cameras(setup: SweepSetup) -> Cameras:
    return setup.cell.camera_model(setup.robot.base.pose())


def _to_target(setup: SweepSetup) -> float:
    """The mean distance in m of the cameras from what they are aimed at."""
    return float(_cameras(setup).depth(setup.robot.base.pose().multiply(1e-3 * setup.cell.target_mm)).mean())


def _number(setup: SweepSetup, value: float) -> SweepPoint:
    """The best cameras for the path, so many of them; never more than there are."""
    cameras, windows = _cameras(setup), setup.cell.windows
    path, workspace = (
        information(cameras, windows, setup.body, places, setup.robot)
        for places in (setup.path, setup.workspace)
    )
    chosen = best_subsets(path)[min(int(value), len(cameras)) - 2]
    on_path, in_workspace = (
        accuracy(pose_covariance(known[:, chosen].sum(1), setup.pixel_sigma)) for known in (path, workspace)
    )
    names = tuple(setup.cell.cameras[i].name for i in chosen)
    return SweepPoint(float(len(chosen)), on_path, in_workspace, setup.pixel_sigma, cameras=names)


def _ring(setup: SweepSetup, value: float, radius: float, height: float, arc_deg: float) -> SweepPoint:
    cell = ring(setup.cell, RING_CAMERAS, radius, height, arc_deg)
    cameras = cell.camera_model(setup.robot.base.pose())
    return _judged(setup, value, cameras, cell.windows, setup.body, setup.pixel_sigma)


def _body(setup: SweepSetup, value: float, body: DetectionBody) -> SweepPoint:
    return _judged(setup, value, _cameras(setup), setup.cell.windows, body, setup.pixel_sigma)


def _markers(setup: SweepSetup, count: int) -> SweepPoint:
    return _body(setup, float(count), with_markers(setup.body, count))


def _pictured(
    setup: SweepSetup,
    value: float,
    images: ImageConfig,
    resolution: float = 1.0,
    body: DetectionBody | None = None,
) -> SweepPoint:
    cameras, windows = with_resolution(_cameras(setup), setup.cell.windows, resolution)
    body = body or setup.body
    some = list(setup.path.X_WE[:: max(1, len(setup.path.X_WE) // PICTURED)])
    try:
        sigma, found = centroid_sigma(cameras, windows, body, images, some, setup.speed, setup.seed)
    except ValueError:  # light stays below the threshold, or noise reaches it
        sigma, found = float("nan"), 0.0
    return _judged(setup, value, cameras, windows, body, sigma, found)


@dataclass(frozen=True)
class Sweep:
    """The varied parameter, its values and the resulting setup."""

    title: str
    unit: str  # of the values, where they have one
    axis: str
    note: str
    values: Sequence[float]
    study: Callable[[SweepSetup, float], SweepPoint]


_ON_ARC = f"{RING_CAMERAS} cameras on an arc of {RING_RADIUS:g} m about the target, {RING_HEIGHT:g} m above."
_ON_RING = f"{RING_CAMERAS} cameras evenly on a full ring about the target,"
_PICTURED = "The error of the centroids is measured in simulated images"
SWEEPS = {
    "cameras": Sweep(
        "Number of cameras", "", "cameras", "The best ones for the path, added one at a time.",
        range(2, 11), _number,
    ),
    "arc": Sweep(
        "Place: around the robot", "°", "arc in degrees", _ON_ARC, (45.0, 90.0, 180.0, 270.0, 360.0),
        lambda setup, value: _ring(setup, value, RING_RADIUS, RING_HEIGHT, value),
    ),
    "distance": Sweep(
        "Place: distance", "m", "radius in m", f"{_ON_RING} {RING_HEIGHT:g} m above.",
        (2.0, 3.0, 4.0, 6.0, 8.0),
        lambda setup, value: _ring(setup, value, value, RING_HEIGHT, 360.0),
    ),
    "height": Sweep(
        "Place: height", "m", "height above the target in m", f"{_ON_RING} its radius {RING_RADIUS:g} m.",
        (-0.3, 0.0, 1.0, 2.0, 4.0),
        lambda setup, value: _ring(setup, value, RING_RADIUS, value, 360.0),
    ),
    "pixel_noise": Sweep(
        "Noise of the pixels", "px", "standard deviation of a marker in the images in px",
        "On the level of features, where it is given.", (0.02, 0.05, 0.1, 0.2, 0.5),
        lambda setup, value: _body(replace(setup, pixel_sigma=value), value, setup.body),
    ),
    "resolution": Sweep(
        "Resolution", "×", "pixels along an edge, times those of the cell", f"{_PICTURED}.",
        (0.25, 0.5, 0.75, 1.0, 1.5, 2.0),
        lambda setup, value: _pictured(setup, value, setup.images, value),
    ),
    "exposure": Sweep(
        "Exposure", "ms", "exposure in ms",
        f"{_PICTURED} at the largest speed of the path: light, saturation and blur.",
        (0.2, 0.3, 0.4, 0.8, 1.6, 3.2),
        lambda setup, value: _pictured(setup, value, replace(setup.images, exposure=1e-3 * value)),
    ),
    "aperture": Sweep(
        "Aperture", "", "f-number",
        f"{_PICTURED}; the lenses are focused at the target's mean distance, and the light is kept.",
        (1.4, 2.8, 5.6, 11.0),
        lambda setup, value: _pictured(
            setup, value, replace(setup.images, f_number=value, focus_distance=_to_target(setup))
        ),
    ),
    "sensor_noise": Sweep(
        "Noise of the sensor", "", "standard deviation of a pixel in full scales", f"{_PICTURED}.",
        (0.0, 0.005, 0.01, 0.02, 0.05),
        lambda setup, value: _pictured(setup, value, replace(setup.images, noise_sigma=value)),
    ),
    "marker_size": Sweep(
        "Size of the markers", "mm", "diameter in mm", f"{_PICTURED}; small ones are not found.",
        (6.0, 8.0, 12.0, 16.0, 25.0),
        lambda setup, value: _pictured(
            setup, value, setup.images, body=replace(setup.body, marker_diameter_mm=value)
        ),
    ),
    "markers": Sweep(
        "Number of markers", "", "markers", "Each as far as possible from those before.", (4, 5, 6, 8, 11),
        lambda setup, value: _markers(setup, min(int(value), len(setup.body))),
    ),
    "body": Sweep(
        "Size of the body", "×", "times its size", "Markers nearer to or farther from the tool.",
        (0.5, 0.75, 1.0, 1.5, 2.0),
        lambda setup, value: _body(setup, value, with_size(setup.body, value)),
    ),
}  # fmt: skip

"""Benchmark of the image pipeline: speed, and accuracy of the centroids.

Only what a real system would have to do is timed: windows, centroids, matching, pose. The pictures are made
beforehand.
"""

import statistics
import time
from collections.abc import Iterator

import numpy as np

from experiments.bench.tracking import PERIOD, PIXEL_SIGMA, Row
from experiments.cameras.accuracy import centroid_errors
from robots.description.model import load_robot
from robots.kinematics.analytic_inverse import InverseKinematics
from robots.kinematics.arm_capsules import ArmCapsules
from robots.pose import pose_error
from systems.cell.imaging.images import ImageConfig, ImageSource
from systems.reference.paths import ReferenceConfig, make_path
from systems.vision.blobs.centroids import CentroidConfig, blobs_in
from systems.vision.camera_rig import load_cell
from systems.vision.marker_body import load_body
from systems.vision.tracking.tracker import Tracker, TrackerState

EVERY = 10  # frames of the path apart
REQUIRED_FRAME_TIME = 3.0  # ms
REQUIRED_CENTROID = 0.1  # px


def images() -> Iterator[Row]:
    """Benchmarks of the tracking on the level of images, along the test path in the shipped cell."""
    cell, body, robot = load_cell("probst"), load_body("probst"), load_robot("irb1200")
    cameras, centroids = cell.camera_model(), CentroidConfig()
    source = ImageSource(cameras, cell.windows, body, ImageConfig(), centroids.threshold)
    tracker, rng = Tracker(cameras, body), np.random.default_rng(0)
    path, inverse, arm = make_path(ReferenceConfig(dwell=0.0)), InverseKinematics(robot), ArmCapsules(robot)
    times = np.arange(EVERY * PERIOD, path.duration, EVERY * PERIOD)
    poses, before = path.sample(times)[0], path.sample(times - PERIOD)[0]
    q, milliseconds, errors, lost = np.zeros(6), [], [], 0
    for X, X_before in zip(poses, before, strict=True):
        q = inverse.nearest(X, q)
        V = pose_error(X, X_before) / PERIOD
        state = TrackerState(0.0, X_before, V)
        expected = tracker.predict(state, PERIOD)
        pictures = source.expose(X, V, rng.standard_normal(2), source.windows(expected), arm.at(q))
        started = time.perf_counter()
        source.windows(tracker.predict(state, PERIOD))
        blobs = blobs_in(pictures, cameras, centroids)
        found = tracker.track(state, PERIOD, blobs)[1]
        milliseconds.append(1e3 * (time.perf_counter() - started))
        lost += not found.valid
        errors.append(centroid_errors(cameras, cell.windows, body, X, blobs)[0])
    text = "images to pose, one frame"
    yield "images_frame", text, statistics.median(milliseconds), "ms", REQUIRED_FRAME_TIME, "allowed"
    yield "images_held", "images, frames of the path lost", lost, "", 1.0, "less than"
    error = np.concatenate(errors)
    yield (
        "images_centroid",
        "centroid, largest error",
        float(np.abs(error).max()),
        "px",
        REQUIRED_CENTROID,
        "allowed",
    )
    text = "centroid, standard deviation"
    yield "images_sigma", text, float(np.sqrt(np.mean(error**2))), "px", PIXEL_SIGMA, "of features"


if __name__ == "__main__":
    for _, name, value, unit, yardstick, against in images():
        print(f"{name:<40} {value:8.3g} {unit:<3} {against} {yardstick:.3g}")

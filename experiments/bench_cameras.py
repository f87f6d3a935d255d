"""The calibration of the cameras: how fast, how exact, and beside OpenCV: python -m, or the bench.

OpenCV's ``calibrateCamera`` gets the points that the adjustment has found and may choose lens and pose of
each camera anew, so that its residual is the smallest possible one.
"""

import time
from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np

from experiments.bench_tracking import Row
from experiments.cameras_calibration import CamerasFound
from systems.tracking.calibration.wand import CalibrationKit, SimulatedWandRun, simulate_wand_run
from systems.tracking.calibration.wand_calibration import calibrate_with_wand
from systems.tracking.measuring_cell import load_cell

REQUIRED_RATIO = 1.02  # of the residual to OpenCV's
REQUIRED_SIGMAS = 3.0  # of a parameter from the truth
ALLOWED_TIME = 5.0  # s, to wait after waving the wand


def cameras() -> Iterator[Row]:
    """Benchmarks of the calibration of the shipped cell from a simulated wand run."""
    cell, kit = load_cell("probst"), CalibrationKit()
    true, names = cell.camera_model(cell.base.pose()), [camera.name for camera in cell.cameras]
    run, _ = simulate_wand_run(true, cell.sensor_px, kit, SimulatedWandRun(), np.random.default_rng(0))
    guess = replace(true, radial=0.0 * true.radial, tangential=0.0 * true.tangential)
    started = time.perf_counter()
    calibration = calibrate_with_wand(run, kit, guess, names)
    seconds = time.perf_counter() - started
    found = CamerasFound(calibration, names, kit, seconds, true)
    yield "cameras_time", "calibration of ten cameras", seconds, "s", ALLOWED_TIME, "allowed"
    size = int(cell.sensor_px[0]), int(cell.sensor_px[1])
    ratios = []
    for i in range(len(names)):
        pixels = run.wand_pixels[i].reshape(-1, 2)
        seen = ~np.isnan(pixels[:, 0])
        points = calibration.wand.reshape(-1, 3)[seen].astype(np.float32)
        K = calibration.cameras.intrinsics[i].copy()
        flags = cv2.CALIB_USE_INTRINSIC_GUESS
        rms, *_ = cv2.calibrateCamera(
            [points], [pixels[seen].astype(np.float32)], size, K, np.zeros(5), flags=flags
        )
        ratios.append(calibration.rms_px[i] / rms)
    text = "calibration, residual over OpenCV's"
    yield "cameras_residual", text, max(ratios), "", REQUIRED_RATIO, "allowed"
    assert found.ratios is not None
    largest = float(np.abs(found.ratios).max())
    yield "cameras_truth", "calibration, error over std", largest, "", REQUIRED_SIGMAS, "allowed"


if __name__ == "__main__":
    for _, name, value, unit, yardstick, against in cameras():
        print(f"{name:<40} {value:8.3g} {unit:<3} {against} {yardstick:.3g}")

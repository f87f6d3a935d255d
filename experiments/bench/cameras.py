"""Benchmark of the camera calibration: speed and accuracy, compared with OpenCV.

OpenCV's ``calibrateCamera`` gets the points that the adjustment has found and may choose lens and pose of
each camera anew, so that its residual is the smallest possible one.
"""

import statistics
import time
from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np

from experiments.bench.tracking import Row
from experiments.cameras.calibration import CamerasFound
from systems.vision.calibration.wand import CalibrationKit, SimulatedWandRun, simulate_wand_run
from systems.vision.calibration.wand_calibration import calibrate_with_wand
from systems.vision.camera_rig import load_cell

REQUIRED_RATIO = 1.02  # of the residual to OpenCV's
RUNS = 8
EXPECTED_BEYOND = 0.27  # percent of what is normally distributed is beyond three standard deviations
ALLOWED_TIME = 5.0  # s, to wait after waving the wand


def cameras() -> Iterator[Row]:
    """Benchmarks of the calibration of the shipped cell from a simulated wand run."""
    cell, kit = load_cell("probst"), CalibrationKit()
    true, names = cell.camera_model(cell.base.pose()), [camera.name for camera in cell.cameras]
    guess = replace(true, radial=0.0 * true.radial, tangential=0.0 * true.tangential)
    runs, calibrations, seconds = [], [], []
    for seed in range(RUNS):
        rng = np.random.default_rng(seed)
        runs.append(simulate_wand_run(true, cell.sensor_px, kit, SimulatedWandRun(), rng)[0])
        started = time.perf_counter()
        calibrations.append(calibrate_with_wand(runs[-1], kit, guess, names))
        seconds.append(time.perf_counter() - started)
    text = "calibration of ten cameras"
    yield "cameras_time", text, statistics.median(seconds), "s", ALLOWED_TIME, "allowed"
    run, calibration = runs[0], calibrations[0]
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
    found = np.array([CamerasFound(each, names, kit, 0.0, true).ratios for each in calibrations])
    text = "calibration, error over its std, rms"
    yield "cameras_spread", text, float(np.sqrt(np.mean(found**2))), "", 1.0, "expected"
    text = "calibration, beyond three std"
    yield "cameras_truth", text, 100.0 * float(np.mean(np.abs(found) > 3.0)), "%", EXPECTED_BEYOND, "expected"


if __name__ == "__main__":
    for _, name, value, unit, yardstick, against in cameras():
        print(f"{name:<40} {value:8.3g} {unit:<3} {against} {yardstick:.3g}")

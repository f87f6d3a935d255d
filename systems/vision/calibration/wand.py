"""The calibration wand, the L-frame on the floor, and the observations of both; simulated ones, too."""

from dataclasses import dataclass, field

import numpy as np

from systems.vision.camera_model import Cameras
from systems.vision.visibility import in_window


@dataclass
class CalibrationKit:
    """The dimensions of wand and L-frame. The L-frame defines the frame Q: origin, axes and scale."""

    wand_length_mm: float = 601.7  # between the centres of the two spheres at its ends; assumed
    # Standard deviation of that length from place to place, for a wand bends; assumed. What it is wrong by
    # everywhere scales the whole cell; that shows only against the L-frame.
    wand_sigma_mm: float = 0.01
    # The spheres of the L-frame in Q, L1 at the origin, L2 and L3 on the x axis, L4 on the y axis; assumed.
    frame_mm: np.ndarray = field(
        default_factory=lambda: np.array(
            [[0.0, 0.0, 0.0], [200.0, 0.0, 0.0], [550.0, 0.0, 0.0], [0.0, 550.0, 0.0]]
        )
    )

    frame_sigma_mm: float = 0.05  # of the spheres' places along an axis, as they are made; assumed

    @property
    def p_Q(self) -> np.ndarray:
        """The spheres of the frame in m, (k, 3)."""
        return 1e-3 * np.asarray(self.frame_mm, dtype=float)

    @property
    def frame_scale_sigma(self) -> float:
        """Standard deviation of the scale of the frame, over its longest distance."""
        between = np.linalg.norm(self.frame_mm[:, None] - self.frame_mm, axis=-1)
        return float(np.sqrt(2.0) * self.frame_sigma_mm / between.max())


@dataclass(frozen=True)
class WandRun:
    """Observations of n cameras: the L-frame, and the wand in f poses; NaN where nothing was seen."""

    frame_pixels: np.ndarray  # the mean over all exposures, (n, k, 2)
    frame_exposures: np.ndarray  # of how many it is the mean, (n, k)
    wand_pixels: np.ndarray  # the third axis is the end, (n, f, 2, 2)


@dataclass
class SimulatedWandRun:
    """Motion and noise of a simulated wand calibration."""

    places: int = 1000  # of the wand that are recorded, evenly in time
    middle_mm: np.ndarray = field(default_factory=lambda: np.array([400.0, 265.0, 1000.0]))  # in Q
    reach_mm: np.ndarray = field(
        default_factory=lambda: np.array([1800.0, 1800.0, 900.0])
    )  # about the middle
    pixel_sigma: float = 0.1  # px, of a sphere along u and v
    frame_exposures: int = 100  # of the frame, whose mean is taken
    false_share: float = 0.0  # of the pixels that are taken from something else


def simulate_wand_run(
    cameras: Cameras,
    sensor_px: np.ndarray,
    kit: CalibrationKit,
    run: SimulatedWandRun,
    rng: np.random.Generator,
) -> tuple[WandRun, np.ndarray]:
    """Simulates the observations of a moving wand and of the L-frame, over the whole sensor of each camera.

    Args:
        cameras: in the frame Q of the camera system, n of them.
        sensor_px: width and height of all of them.
        kit: wand and frame.
        run: how it is waved.
        rng: of the noise and of the motion.

    Returns:
        What was seen, and where the ends of the wand truly were in m, shape (f, 2, 3).

    Raises:
        ValueError: if a number is out of its range.
    """
    for name in ("places", "frame_exposures"):
        if getattr(run, name) < 1:
            raise ValueError(f"wand run: {name} must be at least 1, got {getattr(run, name)}")
    if not (run.pixel_sigma >= 0.0 and 0.0 <= run.false_share < 1.0):
        raise ValueError(f"wand run: pixel_sigma must not be negative, got {run.pixel_sigma} px")
    # A slow tour through the volume and a faster turning, with periods that never meet again.
    phase = np.linspace(0.0, 1.0, run.places)[:, None]
    start = rng.uniform(0.0, 2.0 * np.pi, 6)
    tour = np.sin(2.0 * np.pi * np.array([7.0, 11.3, 17.9]) * phase + start[:3])
    turning = 2.0 * np.pi * np.array([23.1, 31.7, 41.3]) * phase + start[3:]
    along = np.sin(turning) + 1e-3
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    middle = 1e-3 * (run.middle_mm + run.reach_mm * tour)
    length = 1e-3 * (kit.wand_length_mm + kit.wand_sigma_mm * rng.standard_normal((run.places, 1)))
    half = 0.5 * length * along
    wand = np.stack([middle - half, middle + half], axis=1)
    wand_pixels = _seen(cameras, sensor_px, wand.reshape(-1, 3), run.pixel_sigma, rng)
    false = rng.uniform(size=wand_pixels.shape[:2]) < run.false_share
    wand_pixels[false] += rng.uniform(5.0, 50.0, (false.sum(), 2))
    frame_sigma = run.pixel_sigma / np.sqrt(run.frame_exposures)
    frame_pixels = _seen(cameras, sensor_px, kit.p_Q, frame_sigma, rng)
    exposures = np.where(np.isnan(frame_pixels[..., 0]), 0, run.frame_exposures)
    return WandRun(frame_pixels, exposures, wand_pixels.reshape(len(cameras), run.places, 2, 2)), wand


def _seen(
    cameras: Cameras, sensor_px: np.ndarray, p_Q: np.ndarray, sigma: float, rng: np.random.Generator
) -> np.ndarray:
    pixels = cameras.project(p_Q)
    pixels += sigma * rng.standard_normal(pixels.shape)
    whole = np.tile([0.0, 0.0, *sensor_px], (len(cameras), 1))
    pixels[~in_window(pixels, whole)] = np.nan
    return pixels

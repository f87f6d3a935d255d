"""One check of a station: cameras by fixed markers, joints and tool by six poses."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from diagrams.runs.measurement import MeasurementRun
from diagrams.scenario.scenario import Scenario
from systems.vision.camera_model import Cameras
from systems.vision.reference_markers import ReferenceMarkers

BLOCKS, PER_BLOCK = 20, 25  # means that are taken of the cameras, and images in each
PIXEL_SIGMA = 0.1  # px, of a marker in one image
FRAME_RATE = 250.0  # 1/s


@dataclass(frozen=True)
class CameraTurn:
    """A simulated camera is turned at a time of the check."""

    camera: int
    angle: float  # rad, across its view
    at: float = 1.0  # s


@dataclass(frozen=True)
class BentArm:
    """An arm of the simulated marker body is bent, or its sphere is gone."""

    marker: int
    shift: float  # m along x of the tool; infinite for a sphere that is gone


@dataclass(frozen=True)
class Check:
    """What one check has measured."""

    X_WE: np.ndarray  # of the poses, (6, 4, 4)
    rotations: np.ndarray  # of the cameras in blocks, rad, (blocks, n, 3)
    images: np.ndarray  # of the markers on the body at the poses, means in px, (6, n, m, 2)


def measure_check(
    scenario: Scenario,
    q: np.ndarray,
    cameras: Cameras,
    markers: ReferenceMarkers,
    p_W: np.ndarray,
    p_E: np.ndarray,
    changed: CameraTurn | BentArm | None,
    seed: int,
    progress: Callable[[float], None],
) -> Check:
    """Simulates a check.

    Args:
        scenario: of the station.
        q: configurations in rad, (6, 6).
        cameras: as they were calibrated.
        markers: fixed in the cell.
        p_W: where these are in m, (m, 3).
        p_E: the markers on the body in m, (k, 3).
        changed: a camera or an arm of the body; None for none.
        seed: of the noise.
        progress: is called with the share that is done.

    Raises:
        ValueError: if a part refuses its configuration, or a pose was not seen.
    """
    record = MeasurementRun(scenario).measure(q, seed, progress)
    measured = record.measured
    if len(measured.q) != len(q) or measured.rotation is None:
        seen = ", ".join(map(str, measured.rows))
        raise ValueError(f"health: the camera saw the tool at poses {seen} alone, all {len(q)} are needed")
    X = np.tile(np.eye(4), (len(q), 1, 1))
    X[:, :3, :3], X[:, :3, 3] = measured.rotation, measured.position
    rng = np.random.default_rng((seed, 1))
    pixels = np.tile(markers.pixels, (BLOCKS, 1, 1, 1))
    true, body = cameras, p_E.copy()
    if isinstance(changed, CameraTurn):
        R, k = cameras.R_WC.copy(), changed.camera
        R[k] = Rotation.from_rotvec(changed.angle * R[k][:, 1]).as_matrix() @ R[k]
        true = replace(cameras, R_WC=R)
        pixels[round(changed.at * FRAME_RATE / PER_BLOCK) :] = true.project(p_W)
    elif changed is not None:
        body[changed.marker, 0] += changed.shift
    pixels += PIXEL_SIGMA / np.sqrt(PER_BLOCK) * rng.standard_normal(pixels.shape)
    with np.errstate(invalid="ignore"):
        images = np.array([true.project(body @ pose[:3, :3].T + pose[:3, 3]) for pose in record.truth.X_WE])
    images += PIXEL_SIGMA / np.sqrt(PER_BLOCK) * rng.standard_normal(images.shape)
    return Check(X, markers.rotations(pixels), images)

"""Variations of a cell: fewer cameras, other positions, sharper images, another body."""

from dataclasses import replace

import numpy as np

from systems.vision.camera_model import Cameras
from systems.vision.camera_rig import CellCamera, MeasuringCell
from systems.vision.marker_body import DetectionBody


def best_subsets(information: np.ndarray) -> list[list[int]]:
    """For every number of cameras from two on, which of them serve best, one being added at a time.

    Best is the smallest sum of the positions' variances over the poses; a pose that is not seen counts as
    1 mm.

    Args:
        information: of the cameras on each pose, (p, n, 6, 6).
    """
    n = information.shape[1]

    def cost(chosen: list[int]) -> float:
        total = information[:, chosen].sum(1)
        seen = np.linalg.eigvalsh(total)[:, 0] > 1.0
        variance = np.full(len(total), 1.0)  # with pixels of 1 px, where 0.1 px make 0.1 mm of it
        variance[seen] = np.trace(np.linalg.inv(total[seen])[:, 3:, 3:], axis1=1, axis2=2)
        return float(np.minimum(variance, 1.0).sum())

    pairs = [[i, j] for i in range(n) for j in range(i + 1, n)]
    subsets = [min(pairs, key=cost)]
    while len(subsets[-1]) < n:
        left = [i for i in range(n) if i not in subsets[-1]]
        subsets.append(min(([*subsets[-1], i] for i in left), key=cost))
    return subsets


def ring(cell: MeasuringCell, count: int, radius: float, height: float, arc_deg: float) -> MeasuringCell:
    """Cameras like the first of the cell, evenly on an arc about what it looks at, with whole images.

    Args:
        cell: gives sensor, lens, base and target.
        count: of the cameras.
        radius: of the arc in m.
        height: above the target in m.
        arc_deg: from the first to the last camera; 360 for a ring. Its middle is in front of the robot.
    """
    steps = count if arc_deg >= 360.0 else max(count - 1, 1)
    angles = np.deg2rad(arc_deg) * (np.arange(count) / steps - 0.5)
    around = np.stack([radius * np.cos(angles), radius * np.sin(angles), np.full(count, height)], -1)
    p_B = 1e-3 * cell.target_mm + around
    p_Q = p_B @ cell.base.pose().rotation().matrix().T + cell.base.pose().translation()
    whole = np.array([0.0, 0.0, *cell.sensor_px])
    source = "assumed: on an arc about the target"
    cameras = [
        CellCamera(f"{i + 1:02d}", 1e3 * p, [], whole, cell.cameras[0].lens, source)
        for i, p in enumerate(p_Q)
    ]
    return replace(cell, cameras=cameras)


def with_resolution(cameras: Cameras, windows: np.ndarray, share: float) -> tuple[Cameras, np.ndarray]:
    """Cameras with the same lens before a sensor with other pixels: ``share`` times as many along an edge."""
    return replace(cameras, focal=share * cameras.focal, center=share * cameras.center), share * windows


def with_markers(body: DetectionBody, count: int) -> DetectionBody:
    """The body with its first markers, in an order in which each is as far as possible from those before."""
    distances, order = body.distances, [0]
    while len(order) < count:
        apart = distances[order].min(0)
        order.append(int(np.argmax(apart)))
    return replace(body, markers_mm=np.asarray(body.markers_mm)[order])


def with_size(body: DetectionBody, share: float) -> DetectionBody:
    """The body with its markers ``share`` times as far from the tool's origin."""
    return replace(body, markers_mm=share * np.asarray(body.markers_mm))

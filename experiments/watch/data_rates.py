"""What images of a cell would need of a link: full streams, the windows that are looked at, whole images."""

import numpy as np

from diagrams.scenario.scenario import Scenario
from systems.vision.camera_rig import load_cell
from systems.vision.people.people_detector import reduced

LINK = 10.0  # Gbit/s, of the fibre link of Probst (2024), 8.1
_GREY, _COLOURS = 8, 24  # bit of a pixel


def data_rates(scenario: Scenario) -> dict[str, float]:
    """Rates in Gbit/s by name, of all cameras of `station.overview.cell` together; none is compressed."""
    cell, overview = load_cell(scenario.station.overview.cell), scenario.station.overview
    _, (width, height) = reduced(cell.camera_model(), cell.sensor_px, overview.width)
    windows = cell.windows
    pixels = float(np.prod(windows[:, 2:] - windows[:, :2], axis=1).sum())
    grey = 1e-9 * cell.frame_rate_hz * _GREY
    return {
        "full_streams": round(grey * len(windows) * float(np.prod(cell.sensor_px)), 2),
        "windows": round(grey * pixels, 2),
        "whole_images": round(1e-9 * _COLOURS * len(windows) * width * height / overview.period, 3),
        "link": LINK,
    }

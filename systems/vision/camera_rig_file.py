"""Writing a measuring cell as YAML, and replacing its cameras by calibrated ones."""

from dataclasses import replace

import numpy as np
from pydrake.common.yaml import yaml_dump_typed

from robots.pose import zyx_from_rotation
from systems.vision.camera_model import Cameras
from systems.vision.camera_rig import Lens, MeasuringCell


def cell_text(cell: MeasuringCell) -> str:
    """The cell as YAML with all digits of its numbers, which `measuring_cell.load_cell` reads back."""
    return str(yaml_dump_typed(cell))


def with_cameras(cell: MeasuringCell, cameras: Cameras, source: str) -> MeasuringCell:
    """The cell with other cameras, in its order and with its names and windows.

    Args:
        cell: as it was.
        cameras: in the frame Q of the camera system.
        source: where their numbers come from.
    """
    found = [
        replace(
            camera,
            position_mm=1e3 * cameras.p_WC[i],
            zyx_deg=np.rad2deg(zyx_from_rotation(cameras.R_WC[i])).tolist(),
            lens=Lens(
                focal_length_px=cameras.focal[i],
                principal_point_px=cameras.center[i],
                radial=cameras.radial[i],
                tangential=cameras.tangential[i],
                source=source,
            ),
            source=source,
        )
        for i, camera in enumerate(cell.cameras)
    ]
    return replace(cell, cameras=found)

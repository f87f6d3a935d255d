"""Which cameras a station may have: a class of its configuration for each, one line here."""

from typing import get_args

from robots.configuration.union import short_name
from systems.cell.marker_camera import MarkerFeaturesConfig, MarkerImagesConfig
from systems.cell.pose_camera import PoseCameraConfig

# What `station.camera` may be; without a tag it is the first one. `camera` makes the system.
CameraConfig = PoseCameraConfig | MarkerFeaturesConfig | MarkerImagesConfig
CAMERAS: tuple[str, ...] = tuple(short_name(member) for member in get_args(CameraConfig))

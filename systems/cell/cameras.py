"""Which cameras a station may have: a class of its configuration for each, one line here."""

from systems.cell.marker_camera import MarkerFeaturesConfig, MarkerImagesConfig
from systems.cell.pose_camera import PoseCameraConfig

# What `station.camera` may be; without a tag it is the first one. `camera` makes the system.
CameraConfig = PoseCameraConfig | MarkerFeaturesConfig | MarkerImagesConfig
CAMERAS = ("pose", "features", "images")  # the short names in this order

"""The marker body: positions of the marker centres in the tool frame."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from systems.vision.body_pose import collinear
from systems.vision.data_file import Problem, load_data_file

MINIMUM_MARKERS = 4  # three give a pose, the fourth tells one naming of them from another


@dataclass
class DetectionBody:
    """A rigid body with spherical markers. Load one with `load_body`."""

    name: str = ""
    marker_diameter_mm: float = 16.0
    marker_source: str = ""
    markers_mm: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))  # in the tool's frame
    source: str = ""

    @cached_property
    def p_E(self) -> np.ndarray:
        """The centres of the m markers in the tool's frame in m, (m, 3)."""
        return 1e-3 * np.asarray(self.markers_mm, dtype=float)

    @property
    def diameter(self) -> float:
        """Of one marker in m."""
        return 1e-3 * self.marker_diameter_mm

    @cached_property
    def distances(self) -> np.ndarray:
        """From marker to marker in m, (m, m)."""
        return np.linalg.norm(self.p_E[:, None] - self.p_E, axis=-1)

    def __len__(self) -> int:
        return len(self.markers_mm)


def load_body(name: str) -> DetectionBody:
    """Reads a shipped body by name (``"probst"``) or any body file by its path.

    Raises:
        ValueError: if there is no such file, or it does not describe a body; one line that names file and
            line.
    """
    return load_data_file(name, "body", DetectionBody, _problem)


def smallest_difference(distances: np.ndarray) -> float:
    """The smallest difference between any two of the distances (m, m) between markers, in m."""
    return float(np.diff(np.sort(distances[np.triu_indices(len(distances), 1)])).min())


def _problem(body: DetectionBody) -> Problem | None:
    """Place and reason of the first thing that no body can have, or None."""
    markers = np.asarray(body.markers_mm, dtype=float)
    if markers.ndim != 2 or markers.shape[1:] != (3,) or not np.isfinite(markers).all():
        return ["markers_mm"], f"markers_mm must be rows of three finite numbers, got shape {markers.shape}"
    if len(markers) < MINIMUM_MARKERS:
        return ["markers_mm"], f"needs at least {MINIMUM_MARKERS} markers, got {len(markers)}"
    if not 0.0 < body.marker_diameter_mm < np.inf:
        reason = f"marker_diameter_mm must be positive, got {body.marker_diameter_mm}"
        return ["marker_diameter_mm"], reason
    if collinear(markers):
        return ["markers_mm"], f"the {len(markers)} markers are collinear; turns about their line go unseen"
    apart = body.distances + np.where(np.eye(len(markers)), np.inf, 0.0)
    first, second = np.unravel_index(np.argmin(apart), apart.shape)
    if apart[first, second] < body.diameter:
        return ["markers_mm", int(second)], (
            f"markers {first + 1} and {second + 1} are {1e3 * apart[first, second]:.3g} mm apart, less than "
            f"their diameter of {body.marker_diameter_mm:g} mm (are all coordinates in mm?)"
        )
    return None

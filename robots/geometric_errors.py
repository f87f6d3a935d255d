"""How a true robot differs from its drawing: joint offsets and a displaced, tilted tool.

The nominal model never changes; a true plant takes these errors into the placement of its frames.
"""

from dataclasses import dataclass, field

import numpy as np

from robots.model import NUM_JOINTS


@dataclass
class GeometricErrors:
    """Deviations of the true geometry, Probst (2024), section 2.3 and table 6.1.

    A true joint stands at the measured position plus its offset, eq. (2.47). The tool's translation and
    its ZYX Euler angles (alpha, beta, gamma) are added to the nominal ones, eq. (2.48).
    """

    joint_offset_deg: np.ndarray = field(default_factory=lambda: np.zeros(NUM_JOINTS))
    tool_translation_mm: np.ndarray = field(default_factory=lambda: np.zeros(3))
    tool_zyx_deg: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def joint_offset(self) -> np.ndarray:
        """Joint offsets in rad, shape (6,)."""
        return np.deg2rad(self.joint_offset_deg)

"""What a scenario says of its inverse model."""

from dataclasses import dataclass, field

from systems.feedforward.prefilter import PrefilterConfig


@dataclass
class CorrectionConfig:
    """How the joints make up for a structure that yields."""

    method: str = "least_squares"  # or geometric, with axes 1 to 3 and for the position of the tip alone
    limit_deg: float = 3.0  # of each joint's correction


@dataclass
class FeedforwardConfig:
    """Which inverse model runs beside the law; read from a scenario file."""

    kind: str = "none"  # none, rigid, flexible_joint, elastic_structure or FILE.py:CLASS
    # By which shares stiffness and damping, and masses and inertias, of the model are above the robot's.
    stiffness_error: float = 0.0
    inertia_error: float = 0.0
    correction: CorrectionConfig = field(default_factory=CorrectionConfig)
    prefilter: PrefilterConfig = field(default_factory=PrefilterConfig)

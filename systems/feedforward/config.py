"""What a scenario says of its inverse model."""

from dataclasses import dataclass, field

from robots.configuration.quantity import choice, file_name, quantity
from systems.feedforward.predictive.config import PredictiveConfig
from systems.feedforward.prefilter import PrefilterConfig


@dataclass
class CorrectionConfig:
    """How the joints make up for a structure that yields."""

    # Geometric and direct: with axes 1 to 3, for the position of the tip alone; direct is exact, not damped
    method: str = choice("least_squares", ("least_squares", "geometric", "direct"))
    limit_deg: float = quantity(3.0, 0.0, 90.0, "deg", is_open=True)  # of each joint's correction


@dataclass
class FeedforwardConfig:
    """Which inverse model runs beside the law; read from a scenario file."""

    kind: str = file_name("none")  # none, one of `systems.feedforward.FEEDFORWARDS` or FILE.py:CLASS
    # By which share stiffness and damping of the model are above the robot's
    stiffness_error: float = quantity(0.0, -0.9, 10.0)
    # By which share masses and inertias of the model are above the robot's
    inertia_error: float = quantity(0.0, -0.9, 10.0)
    # Of the stable inverse: which point is exact, the tip or where axes 4, 5 and 6 meet
    point: str = choice("tip", ("tip", "wrist"))
    # Of `corrected`: where gears without load rest in their play before the motion, anywhere or where the
    # station's camera, which then looks at the robot before the run, sees them
    resting: str = choice("anywhere", ("anywhere", "seen"))
    # What becomes of a path with too few continuous derivatives: refuse it, or accept torques that jump
    rough_path: str = choice("refuse", ("refuse", "accept"))
    correction: CorrectionConfig = field(default_factory=CorrectionConfig)
    prefilter: PrefilterConfig = field(default_factory=PrefilterConfig)
    predictive: PredictiveConfig = field(default_factory=PredictiveConfig)

"""What is known before anything is measured, and how often the past is read again."""

from dataclasses import dataclass, field

from systems.estimation.tip_model import Spread


@dataclass
class TipEstimatorConfig:
    """What is known of robot and camera before anything is measured."""

    spread: Spread = field(default_factory=Spread)
    position_sigma: float = 60e-6  # m, of a camera sample and of what no parameter describes
    rotation_sigma: float = 2.1e-4  # rad
    keyframe_step: float = 0.012  # rad, samples nearer than this in every joint are merged
    keyframe_samples: int = 100  # the most samples in one
    relinearise: float = 3e-4  # m or rad, a change of a parameter after which the past is read anew
    geometry_step: float = 1e-4  # m or rad, within which poses are linear in the parameters
    calm: float = 0.05  # m/s^2, of the tip by parameters that are led in: more makes samples count less
    # Events are looked for after so many samples, and where a camera is slow after so many seconds
    test_after: int = 250
    test_at_latest: float = 3.0

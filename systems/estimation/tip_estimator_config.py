"""What is known before anything is measured, and how often the past is read again."""

from dataclasses import dataclass, field

from robots.configuration.quantity import positive, quantity
from systems.estimation.tip_model import Spread


@dataclass
class TipEstimatorConfig:
    """What is known of robot and camera before anything is measured."""

    spread: Spread = field(default_factory=Spread)
    position_sigma: float = positive(60e-6, "m")  # of a camera sample and of what no parameter describes
    rotation_sigma: float = positive(2.1e-4, "rad")
    keyframe_step: float = positive(0.012, "rad")  # samples nearer than this in every joint are merged
    keyframe_samples: int = quantity(100, 1)  # the most samples in one
    relinearise: float = positive(3e-4)  # m or rad, a change of a parameter after which the past is read anew
    geometry_step: float = positive(1e-4)  # m or rad, within which poses are linear in the parameters
    # Of the tip by parameters that are led in: more makes samples count less
    calm: float = positive(0.05, "m/s^2")
    # Of the variance that play of gears admits, the share that is believed in what a camera shows of their
    # teeth, so that it is fed back; 0 feeds nothing back
    gear_feedback: float = quantity(0.3, 0.0, 1.0)
    # Events are looked for after so many samples, and where a camera is slow after so many seconds
    test_after: int = quantity(250, 1)
    test_at_latest: float = quantity(3.0, 0.0, unit="s")

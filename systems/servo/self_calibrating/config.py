"""What the self-calibrating law knows beforehand and may do."""

from dataclasses import dataclass, field

from robots.configuration.quantity import choice, positive, quantity
from systems.estimation.drives.dead_time import DeadTimeConfig
from systems.estimation.drives.drive_config import DriveModelConfig
from systems.estimation.probing.probe import ProbeConfig
from systems.estimation.tip_estimator_config import TipEstimatorConfig
from systems.servo.law_config import LawConfig


@dataclass
class SelfCalibratingConfig(LawConfig):
    """What the law knows beforehand and may do; read from a scenario file."""

    # The drive that the law commands
    drive: str = choice("cascade", ("position", "velocity", "cascade"))
    estimator: TipEstimatorConfig = field(default_factory=TipEstimatorConfig)
    drives: DriveModelConfig = field(default_factory=DriveModelConfig)
    dead_time: DeadTimeConfig = field(default_factory=DeadTimeConfig)
    probe: ProbeConfig = field(default_factory=ProbeConfig)
    lead_frequency: float = positive(30.0, "rad/s")  # at most, with which parameters follow their estimate
    lead_acceleration: float = positive(0.5, "m/s^2")  # at most, that this gives the tip
    # Standard deviation: where the tip ahead is known less well, the path waits for a camera that is blind
    known_ahead: float = positive(2e-5, "m")
    # Likewise: where it is known n times less well, the path goes on at one nth of its speed, or a quarter.
    # Where gears err it counts more often, 7 times at 4 ms, see `systems.servo.self_calibrating.ahead.Pace`
    known_on_path: float = positive(3e-5, "m")
    longest_wait: float = quantity(2.0, 0.0, unit="s")  # that it waits

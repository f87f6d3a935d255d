"""Gains and limits of a law, as a scenario has them."""

from dataclasses import dataclass

from robots.configuration.quantity import choice, quantity


@dataclass
class LawConfig:
    """What every law has; a law with more extends it."""

    translation: float = quantity(5.0, 1e-3, 1000.0, "1/s")  # gain on the error of the tool's position
    rotation: float = quantity(5.0, 1e-3, 1000.0, "1/s")  # gain on the error of the tool's orientation
    # The drive that the law commands
    drive: str = choice("position", ("position", "velocity", "cascade"))
    correction_limit: float = quantity(0.1, 1e-4, 2.0, "m")  # the largest correction of the position
    # The largest correction of the orientation
    correction_limit_deg: float = quantity(20.0, 0.01, 180.0, "deg")

"""Gains and limits of a law, as a scenario has them."""

from dataclasses import dataclass


@dataclass
class LawConfig:
    """What every law has; a law with more extends it."""

    translation: float = 5.0  # 1/s
    rotation: float = 5.0  # 1/s
    drive: str = "position"  # the drive that the law commands: position, velocity or cascade
    correction_limit: float = 0.1  # m, the largest correction of the position
    correction_limit_deg: float = 20.0  # the largest correction of the orientation
    correction_speed_limit_deg_s: float = 30.0  # of one joint, where a law corrects velocities
    angles: str = (
        "rotation_vector"  # how position_level corrects the orientation; or euler, as the source does
    )

"""Which turns of the joints bring the tip of a deformed arm back to where that of a rigid one would be."""

from dataclasses import dataclass

import numpy as np

METHODS = ("least_squares", "geometric")


@dataclass
class CorrectionConfig:
    """How the joints make up for a structure that yields; read from a scenario file."""

    method: str = "least_squares"  # or geometric, with axes 1 to 3 and for the position of the tip alone
    limit_deg: float = 3.0  # of each joint's correction

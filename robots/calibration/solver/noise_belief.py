"""What is believed of the noise of a table that holds hardly more numbers than there are parameters.

A fit through as many numbers as it has parameters leaves nothing of them, however noisy they are. What the
noise usually is then counts as much as one number of each kind, and the fewer numbers are left over, the more
the estimate is this belief: with none it is nothing else.
"""

import numpy as np

from robots.calibration.measurements import SOURCE_NOISE
from robots.calibration.solver.noise_model import Noise
from robots.calibration.solver.problem import Linearised

# Variances of joint, position and rotation in rad^2, m^2, rad^2. Without the joints, as in the criteria of
# measurement designs: few numbers do not tell their noise from that of the instrument.
BELIEVED = np.array([0.0, SOURCE_NOISE.position_sigma, SOURCE_NOISE.rotation_sigma]) ** 2
WEIGHT = 1.0  # numbers, of each kind
ENOUGH = 15.0  # numbers that a fit leaves over, from which the noise is told without a belief


def taken(at: Linearised, noise: Noise) -> float:
    """How many numbers a fit takes from the rows to find its parameters; what the prior holds takes none."""
    s = np.linalg.svd(at.triangle(noise), compute_uv=False)
    return float(np.sum(s**2 / (1.0 + s**2)))

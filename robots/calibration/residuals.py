"""What an identification leaves of its rows, in units of what is expected."""

import numpy as np

from robots.calibration.error_model import ZEROS
from robots.calibration.identified import Identified
from robots.calibration.solver.noise_model import FLOOR, NoiseModel, row_sigmas


def standardised(found: Identified) -> np.ndarray:
    """Residuals made white and of unit size by the noise of their rows, (n, k).

    Noise of the joints reaches a row through the Jacobian, so that its numbers are correlated before.
    """
    _, Theta = found.model.forward_and_regressor(found.measurements.q, found.x)
    J = Theta[:, 6 - found.residuals.shape[1] :, ZEROS]
    noise = found.noise
    sigmas = np.array([noise.joint_sigma, noise.position_sigma, noise.rotation_sigma])
    sigmas[1:] = np.maximum(sigmas[1:], FLOOR)
    W = NoiseModel(sigmas**2, row_sigmas(found.measurements).shape).whitening(J)
    return np.einsum("nij,nj->ni", W, found.residuals)


def expected_spread(found: Identified) -> float:
    """Standard deviation of standardised residuals where the noise is right: a fit makes it less than one."""
    s = np.linalg.svd(found.design, compute_uv=False)
    fitted = float(np.sum(s**2 / (1.0 + s**2)))  # a parameter that the prior holds takes nothing away
    numbers = int(found.kept.sum()) * found.residuals.shape[1]
    return float(np.sqrt(max(1.0 - fitted / numbers, 0.0)))

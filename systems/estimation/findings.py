"""What has been learnt of a robot, in names and units for people and files."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from systems.estimation.tip_estimator import TipEstimator


def findings(estimator: TipEstimator, memory: SimpleNamespace) -> dict[str, Any]:
    """The estimate with its standard deviations.

    Args:
        estimator: whose unknowns these are.
        memory: of the estimator.

    Returns:
        ``clock_offset_s``: what is to be added to the camera's stamps; ``mass_kg`` of the payload; and
        ``parameters``: by name a ``value`` and its ``sigma`` in m or rad for geometric errors, as factors of
        what is believed for the compliance of ``gear_i`` and ``bearing_a_i``, ``bearing_b_i``.
    """
    model = estimator.model
    x = estimator.x(memory)
    sigma = model.sigma * np.sqrt(np.diag(estimator.covariance(memory)))
    names = [model.parameters[i].name for i in model.chosen]
    names += [f"gear_{i}" for i in range(1, 7)]
    names += [f"bearing_{side}_{i}" for i in range(1, 7) for side in "ab"]
    return {
        "clock_offset_s": float(x[model.C]),
        "mass_kg": float(x[model.M][0]),
        "parameters": {
            name: {"value": float(value), "sigma": float(spread)}
            for name, value, spread in zip(names, x, sigma, strict=False)
        },
    }

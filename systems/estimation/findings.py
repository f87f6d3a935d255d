"""What has been learnt of a robot, in names and units for people and files."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from systems.estimation.gears.gear_errors import SHAPE_NAMES
from systems.estimation.learnt_robot import BEARING_NAMES, GEAR_NAMES, learnt_robot
from systems.estimation.probing.path_needs import Standing
from systems.estimation.tip_estimator import TipEstimator


def findings(estimator: TipEstimator, memory: SimpleNamespace) -> dict[str, Any]:
    """The estimate with its standard deviations.

    Args:
        estimator: whose unknowns these are.
        memory: of the estimator.

    Returns:
        ``clock_offset_s``: what is to be added to the camera's stamps now, and ``clock_drift_ppm`` by which
        that changes; ``mass_kg`` of the payload; and
        ``parameters``: by name a ``value`` and its ``sigma`` in m or rad for geometric errors, as factors of
        what is believed for the compliance of ``gear_i`` and ``bearing_a_i``, ``bearing_b_i``.
    """
    model = estimator.model
    x = estimator.x_robot(memory)
    sigma = model.sigma * np.sqrt(np.diag(estimator.covariance_of_robot(memory)))
    names = _names(estimator)
    return {
        "clock_offset_s": estimator.clock_offset(memory, float(memory.last_time[0])),
        "clock_drift_ppm": 1e6 * float(x[model.D]),
        "mass_kg": float(x[model.M][0]),
        "parameters": {
            name: {"value": float(value), "sigma": float(spread)}
            for name, value, spread in zip(names, x, sigma, strict=False)
        },
    }


def calibrated_robot(estimator: TipEstimator, memory: SimpleNamespace, of: str) -> RobotModel:
    """The robot as it is known now, for a robot file: geometry, springs, and how well these are known.

    Args:
        estimator, memory: as of `findings`.
        of: the robot that was calibrated, as `robots.description.model.load_robot` takes it.
    """
    model, names = estimator.model, _names(estimator)
    x, count = estimator.x_robot(memory), len(names)
    covariance = (np.outer(model.sigma, model.sigma) * estimator.covariance_of_robot(memory))[:count, :count]
    known = names, x[:count], covariance
    return learnt_robot(model.robot, model.geometric_errors(x), x[model.K], known, of)


def path_knowledge(estimator: TipEstimator, standing: Standing) -> dict[str, Any]:
    """How well the tip is known where it is known worst on the path, and because of what.

    Returns:
        ``tip_sigma_m`` at ``time_s`` of the path; ``parameter``, which has the largest part in it, with its
        ``parameter_sigma`` in its ``unit`` (1 for factors of compliances) and its ``share`` of the variance.
    """
    name, unit = _names_and_units(estimator)[standing.unknown]
    return {
        "tip_sigma_m": standing.sigma,
        "time_s": standing.time,
        "parameter": name,
        "parameter_sigma": standing.unknown_sigma,
        "unit": unit,
        "share": standing.share,
    }


def _names_and_units(estimator: TipEstimator) -> list[tuple[str, str]]:
    model = estimator.model
    geometry = [(model.parameters[i].name, model.parameters[i].unit) for i in model.chosen]
    springs = [(name, "1") for name in (*GEAR_NAMES, *BEARING_NAMES)]
    moments = [(f"payload_moment_{axis}", "kg m") for axis in "xyz"]
    others = [("payload", "kg"), *moments, ("clock_offset", "s"), ("clock_drift", "s/s")]
    shapes = [(f"gear_error_{shape}_{i + 1}", "rad") for shape in SHAPE_NAMES for i in range(NUM_JOINTS)]
    return [*geometry, *springs, *others, *(shapes if model.has_gear_errors else [])]


def _names(estimator: TipEstimator) -> list[str]:
    model = estimator.model
    return [*(model.parameters[i].name for i in model.chosen), *GEAR_NAMES, *BEARING_NAMES]

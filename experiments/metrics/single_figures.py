"""A run in a few single numbers, as tables of many runs have them."""

import math

import numpy as np

from diagrams.record.log import RunLog
from experiments.metrics.laps import lap_metrics
from experiments.metrics.run_metrics import error_metrics, judged_source, pose_errors

FIGURES = {
    "max_norm_mm": "largest distance of the tip from its path in mm",
    "rms_norm_mm": "root mean square of the distance in mm",
    "max_angle_deg": "largest angle between the tool and its wanted orientation in degrees",
    "static_mm": "distance at rest at the end in mm",
    "static_deg": "angle at rest at the end in degrees",
    "settling_s": "time until the initial error has died away in s",
    "last_lap_mm": "largest distance in the last lap in mm",
    "guard_ticks": "ticks in which the guard intervened",
}


def single_figures(log: RunLog) -> dict[str, float]:
    """The `FIGURES` of a run, true where the truth is known; NaN for what there is not."""
    source = judged_source(log)
    errors = error_metrics(log, source)
    last_lap = lap_metrics(log, pose_errors(log, source))[-1]
    settling = errors["settling_s"]
    return {
        "max_norm_mm": errors["max_norm_mm"],
        "rms_norm_mm": errors["rms_norm_mm"],
        "max_angle_deg": errors["max_angle_deg"],
        "static_mm": float(np.linalg.norm(errors["static_mm"])),
        "static_deg": float(np.linalg.norm(errors["static_deg"])),
        "settling_s": math.nan if settling is None else settling,
        "last_lap_mm": last_lap["max_norm_mm"],
        "guard_ticks": float(sum(log.guard_counts.values())),
    }

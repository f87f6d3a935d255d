"""Motions that keep their limits in the plant, which is not quite what the planner believes."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from experiments.plan.plant_run import PlantDriver, PlantRun
from experiments.plan.timings import Timing
from robots.description.model import NUM_JOINTS
from robots.planning.limits import JOINT_LIMITS, MotionLimits

_MARGIN = 0.99  # of every limit: what a planner may use at first
_ROUNDS = 8
_STEP = 0.995  # beyond what a motion was too much
ROUNDING = 1e-6

T = TypeVar("T", bound=Timing)


@dataclass(frozen=True)
class Kept(Generic[T]):
    """A motion and how the plant did it."""

    timing: T
    run: PlantRun
    keeps: bool  # whether all limits were kept
    margins: MotionLimits  # with which it was planned


def kept_in_plant(make: Callable[[MotionLimits], T], driver: PlantDriver, limits: MotionLimits) -> Kept[T]:
    """Plans a motion and drives it, with lower limits where the plant exceeds them, until it does not.

    Args:
        make: the motion within limits.
        driver: drives it.
        limits: that the plant has to keep.
    """
    margins, kept = limits.scaled(_MARGIN), None
    for _ in range(_ROUNDS):
        timing = make(margins)
        run = driver.run(timing)
        keeps = largest_share(run, limits) <= 1.0 + ROUNDING
        kept = Kept(timing, run, keeps, margins)
        if keeps:
            break
        margins = lowered(margins, run, limits)
    assert kept is not None
    return kept


def lowered(margins: MotionLimits, run: PlantRun, limits: MotionLimits) -> MotionLimits:
    """What a planner may use next, where the plant has exceeded limits with the present margins.

    A rate that is too high makes gears ring, and that is what exceeds other limits mostly: it comes first.
    """
    shares = exceeded(run, limits)
    if shares["gear_torque_rate"].max() > 1.0 + ROUNDING:
        shares = {"gear_torque_rate": shares["gear_torque_rate"]}
    return replace(
        margins,
        **{
            name: getattr(margins, name) * np.where(share > 1.0, _STEP / np.maximum(share, 1.0), 1.0)
            for name, share in shares.items()
        },
    )


def exceeded(run: PlantRun, limits: MotionLimits) -> dict[str, np.ndarray]:
    """The largest share of every limit of joints by its name, shape (6,)."""
    shares = {
        name: np.abs(getattr(run.demand, name)).max(axis=0) / getattr(limits, name)
        for name in JOINT_LIMITS
        if name != "continuous_torque"
    }
    return {**shares, "continuous_torque": run.use(limits).mean_torque[:NUM_JOINTS]}


def largest_share(run: PlantRun, limits: MotionLimits) -> float:
    """Of any limit of joints at any time."""
    return float(max(each.max() for each in exceeded(run, limits).values()))

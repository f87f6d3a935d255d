"""Motions that keep their limits in the plant, which is not quite what the planner believes."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from experiments.plan.plant_run import PlantDriver, PlantRun
from experiments.plan.timings import Timing
from robots.description.model import NUM_JOINTS
from robots.planning.limits import JOINT_LIMITS, OVER_TIME, MotionLimits

_MARGIN = 0.99  # of every limit: what a planner may use at first
_ROUNDS = 12
_THERE = 9  # of them with lower limits at the times at which they were exceeded, then at all
_TIMES = 61  # of a motion, between which limits are lowered evenly
_NEAR = 0.012  # s, and 1.5 of these times: what the plant exceeds is somewhat late, and moves
_MORE = 1.1  # power of what it was too much
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


def kept_in_plant(
    make: Callable[[MotionLimits], T], driver: PlantDriver, limits: MotionLimits, varies: bool = False
) -> Kept[T]:
    """Plans a motion and drives it, with lower limits where the plant exceeds them, until it does not.

    Args:
        make: the motion within limits.
        driver: drives it.
        limits: that the plant has to keep.
        varies: whether the motion can keep limits that are lower at some of its times only.
    """
    margins, kept = limits.scaled(_MARGIN), None
    for number in range(_ROUNDS):
        timing = make(margins)
        run = driver.run(timing)
        keeps = largest_share(run, limits) <= 1.0 + ROUNDING
        kept = Kept(timing, run, keeps, margins)
        if keeps:
            break
        lower = lowered_there if varies and number < _THERE else lowered
        margins = lower(margins, run, limits)
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


def lowered_there(margins: MotionLimits, run: PlantRun, limits: MotionLimits) -> MotionLimits:
    """The same about the times at which the plant has exceeded limits; over all where that was after the end.

    A quick motion exceeds its limits for some hundredths of a second, at its start and end most of all. With
    lower limits at all times it would be slower than it has to be in between.
    """
    used = np.stack([np.abs(getattr(run.demand, name)) / getattr(limits, name) for name in OVER_TIME], axis=1)
    mean = run.use(limits).mean_torque[:NUM_JOINTS]
    if used[run.times > run.duration].max(initial=0.0) > 1.0 + ROUNDING:
        return lowered(margins, run, limits)
    x = np.linspace(0.0, 1.0, _TIMES)
    shares, near = margins.shares_at(x), max(1.5 / (_TIMES - 1), _NEAR / run.duration)
    for share, at in zip(shares, x, strict=True):
        there = np.abs(np.clip(run.times / run.duration, 0.0, 1.0) - at) <= near
        most = used[there].max(axis=0, initial=1.0)
        share *= np.where(most > 1.0, (_STEP / most) ** _MORE, 1.0)
    continuous = margins.continuous_torque * np.where(mean > 1.0, _STEP / np.maximum(mean, 1.0), 1.0)
    return replace(margins, shares=shares, continuous_torque=continuous)


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

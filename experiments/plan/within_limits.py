"""Motions that keep their limits in the plant, which is not quite what the planner believes."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
from scipy.integrate import cumulative_trapezoid

from experiments.plan.plant_run import PlantDriver, PlantRun
from experiments.plan.timings import Timing
from robots.description.model import NUM_JOINTS
from robots.planning.limits import JOINT_LIMITS, OVER_TIME, MotionLimits
from robots.planning.path_dynamics import Demand

_MARGIN = 0.99  # of every limit: what a planner may use at first
_ROUNDS = 12
_THERE = 9  # of them with lower limits at the times at which they were exceeded, then at all
_TIMES = 61  # of a motion, between which limits are lowered evenly
_NEAR = 0.012  # s, and 1.5 of these times: what the plant exceeds is somewhat late, and moves
_MORE = 1.1  # power of what it was too much
_STEP = 0.995  # beyond what a motion was too much
_ALL_BUT = 0.998  # of a limit: what the plant shall use of it
_BINDS = 0.97  # of what it may use, from which on a planner is held back by a limit
_HIGHER = 1.06  # times a limit at most, and in one step times
_HIGHER_AT_ONCE = 1.02
_OF_JERK = 3  # power of what a motor was too quick by
_SLOWER = 0.9  # of its motor's speed: a link is clearly slower
ROUNDING = 1e-6

T = TypeVar("T", bound=Timing, covariant=True)


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
        is_in_vain = kept is not None and abs(timing.duration / kept.timing.duration - 1.0) < ROUNDING
        run = driver.run(timing)
        keeps = largest_share(run, limits) <= 1.0 + ROUNDING
        kept = Kept(timing, run, keeps, margins)
        if keeps:
            break
        if varies and number < _THERE:
            margins = lowered_there(margins, run, limits)
        else:
            margins = lowered(margins, run, limits, is_in_vain)
    assert kept is not None
    return kept


def lowered(
    margins: MotionLimits, run: PlantRun, limits: MotionLimits, of_all_joints: bool = False
) -> MotionLimits:
    """What a planner may use next, where the plant has exceeded limits with the present margins.

    A rate that is too high makes gears ring, and that is what exceeds other limits mostly: it comes first. If
    a motor is too quick while its link is not, it is the jerk.

    Args:
        margins: with which the motion was planned.
        run: of it.
        limits: that it has to keep.
        of_all_joints: also for joints that keep a limit; where a lower one of a joint had no effect.
    """
    shares = exceeded(run, limits)
    if shares["gear_torque_rate"].max() > 1.0 + ROUNDING:
        shares = {"gear_torque_rate": shares["gear_torque_rate"]}
    elif (ahead := _ahead_of_links(run, limits)).any():
        jerk = np.abs(run.demand.jerk).max(axis=0)
        less = jerk * (_STEP / shares["speed"][ahead].max()) ** _OF_JERK
        return replace(margins, jerk=np.where(jerk > 0.0, np.minimum(margins.jerk, less), margins.jerk))
    if of_all_joints:
        shares = {name: np.full_like(share, share.max()) for name, share in shares.items()}
    return replace(
        margins,
        **{
            name: getattr(margins, name) * np.where(share > 1.0, _STEP / np.maximum(share, 1.0), 1.0)
            for name, share in shares.items()
        },
    )


def _ahead_of_links(run: PlantRun, limits: MotionLimits) -> np.ndarray:
    """Whose motors exceed their speed when their links are clearly slower, (6,)."""
    motors = np.abs(run.demand.speed)
    links = np.abs(cumulative_trapezoid(run.demand.acceleration, run.times, axis=0, initial=0.0))
    worst = motors.argmax(axis=0), np.arange(NUM_JOINTS)
    return (motors[worst] > (1.0 + ROUNDING) * limits.speed) & (links[worst] < _SLOWER * motors[worst])


def lowered_there(margins: MotionLimits, run: PlantRun, limits: MotionLimits) -> MotionLimits:
    """The same about the times at which the plant has exceeded limits; over all where that was after the end.

    A quick motion exceeds its limits for some hundredths of a second, at its start and end most of all. With
    lower limits at all times it would be slower than it has to be in between.
    """
    used = _used(run.demand, limits)
    if used[run.times > run.duration].max(initial=0.0) > 1.0 + ROUNDING:
        return lowered(margins, run, limits)
    x = np.linspace(0.0, 1.0, _TIMES)
    shares, near = margins.shares_at(x), max(1.5 / (_TIMES - 1), _NEAR / run.duration)
    for share, at in zip(shares, x, strict=True):
        there = np.abs(np.clip(run.times / run.duration, 0.0, 1.0) - at) <= near
        most = used[there].max(axis=0, initial=1.0)
        share *= np.where(most > 1.0, (_STEP / most) ** _MORE, 1.0)
    return replace(margins, shares=shares, continuous_torque=_cooler(margins, run, limits))


def adapted(
    margins: MotionLimits,
    run: PlantRun,
    planned: Demand,
    limits: MotionLimits,
    power: float,
    is_raised: bool,
) -> MotionLimits:
    """What a planner may use next, so that the plant comes close to its limits and keeps them.

    About times at which the plant has exceeded a limit it is lower, for all times where that was after the
    end. Where the planner was held back by a limit and the plant was not, it may be higher.

    Args:
        margins: with which the motion was planned.
        run: of it.
        planned: what the planner believes of it, at even times from its start to its end.
        limits: that the plant has to keep.
        power: of what was too much or too little; below 1 for small steps, as a step at one time moves
            what happens at the next.
        is_raised: whether limits may be higher, too.
    """
    used, wanted = _used(run.demand, limits), _used(planned, limits)
    after = used[run.times > run.duration].max(axis=0, initial=1.0)
    moving = (run.times >= 0.0) & (run.times <= run.duration)
    x = np.linspace(0.0, 1.0, _TIMES)
    even = np.linspace(0.0, 1.0, len(wanted))
    shares, near = margins.shares_at(x), max(1.5 / (_TIMES - 1), _NEAR / run.duration)
    for share, at in zip(shares, x, strict=True):
        most = used[moving & (np.abs(run.times / run.duration - at) <= near)].max(axis=0, initial=0.0)
        factor = (_ALL_BUT / np.maximum(most, 0.5)) ** power
        binds = wanted[np.abs(even - at) <= near].max(axis=0) > _BINDS * share
        higher = np.where(binds & is_raised, np.minimum(factor, _HIGHER_AT_ONCE), 1.0)
        share *= np.where(most > 1.0, factor, np.where(most < _ALL_BUT, higher, 1.0))
        np.minimum(share, _HIGHER, out=share)
        share *= np.where(after > 1.0, (_ALL_BUT / after) ** power, 1.0)
    return replace(margins, shares=shares, continuous_torque=_cooler(margins, run, limits))


def _used(demand: Demand, limits: MotionLimits) -> np.ndarray:
    """Shares of `OVER_TIME`, (n, limits, 6)."""
    return np.stack([np.abs(getattr(demand, name)) / getattr(limits, name) for name in OVER_TIME], axis=1)


def _cooler(margins: MotionLimits, run: PlantRun, limits: MotionLimits) -> np.ndarray:
    """The continuous torque, lower where motors would become too warm."""
    mean = run.use(limits).mean_torque[:NUM_JOINTS]
    return margins.continuous_torque * np.where(mean > 1.0, _STEP / np.maximum(mean, 1.0), 1.0)


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

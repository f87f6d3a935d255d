"""Plans motions, drives them in the plant, and does the same with the timing that they replace."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from experiments.cli.option_limits import one_of
from experiments.plan.free_leg import free_legs, is_clear
from experiments.plan.legs import Leg, legs_of
from experiments.plan.plant_run import PlantDriver
from experiments.plan.timed_leg import TimedLeg, timed_leg
from experiments.plan.timings import SineSquared, Timing, quickest
from experiments.plan.within_limits import ROUNDING, Kept, kept_in_plant, largest_share, lowered_there
from robots.description.model import RobotModel
from robots.measurement_design.obstacles import Obstacle
from robots.planning.jerk_profile import best_jerk_profile
from robots.planning.joint_path import Curve, PathError
from robots.planning.limit_use import energy, require_standing
from robots.planning.limits import MotionLimits
from robots.planning.optimum import ITERATIONS, Optimum, calmed, optimum
from robots.planning.path_dynamics import PathDynamics
from robots.planning.rigid_start import rigid_start
from robots.planning.ringing import ringing_band
from robots.planning.time_spline import TimeSpline, fitted

OBJECTIVES = ("time", "energy", "front")
COEFFICIENTS = 36  # of the spline: about one for each tick of some 12 ms of a quick motion
STILL = 2e-4  # m/s, C that is none: 0.2 mm/s^2 in the mean
# Of the time that is gained, which is given away for calm.
_CALMER = (0.03, 0.12, 0.2, 0.3, 0.42, 0.55, 0.67, 0.8, 0.9, 1.0)
_CALMER_ENERGY = (
    1e-4,
    3e-4,
    1e-3,
    3e-3,
    0.01,
    0.03,
    0.1,
    0.4,
    1.0,
    10.0,
    40.0,
    100.0,
    150.0,
    220.0,
)  # weights of calm
_ROUNDS = 3  # with lower limits, where a calm motion exceeds them in the plant
_HALVINGS = 2  # of the step, once a motion is calm enough
_SMOOTHER = 10.0  # motions for laws, which are late, and where the optimiser has not converged
# Coefficients and smoothness of quick motions that may ring: limits are used up to the edge.
_SHARP = 60, 0.05
_FRUGAL = 60, 1.0  # the same of frugal motions of joints, which with 36 take 2 % more
_FRONT = (1.0, 1.05, 1.1, 1.2, 1.35, 1.5)  # of the shortest duration


@dataclass(frozen=True)
class Plan:
    """What is asked for.

    Attributes:
        robot: as the planner and the controller know it.
        payload: kg.
        path: see `legs_of`.
        objective: of `OBJECTIVES`.
        dynamics: of `robots.planning.path_dynamics.DYNAMICS`.
        limits: that are kept.
        recuperation: whether braking gives energy back.
        plant: what stands in the station, None for the same robot.
        may_ring: whether a motion may make the arm ring more than the usual timing does.
        is_free: whether the joints may go another way than the usual motion does.
        obstacles: that they keep clear of on it.
        is_for_law: whether a law follows the motion; else it runs open loop.
        others: files that declare what the path, if it is a program, does not.
    """

    robot: RobotModel
    payload: float
    path: str
    objective: str
    dynamics: str
    limits: MotionLimits
    recuperation: bool = False
    plant: RobotModel | None = None
    may_ring: bool = False
    is_free: bool = False
    obstacles: tuple[Obstacle, ...] = ()
    is_for_law: bool = False
    others: tuple[str, ...] = ()

    def sharpness(self, leg: Leg) -> tuple[int, float]:
        """Coefficients of a leg's spline, and times how much of the usual weight it is kept smooth."""
        if not self.is_for_law and self.objective == "time" and self.may_ring:
            return _SHARP
        if not self.is_for_law and self.objective == "energy" and not leg.is_straight:
            return _FRUGAL
        return COEFFICIENTS, 1.0

    @property
    def times_joints(self) -> bool:
        """Whether each joint may have a time law of its own."""
        tool = np.isfinite([self.limits.tool_speed, self.limits.tool_acceleration]).any()
        is_quick = self.objective == "time" and self.may_ring and not self.is_for_law
        return self.is_free and is_quick and self.dynamics == "elastic_structure" and not tool


@dataclass(frozen=True)
class LegResult:
    """One leg, planned and with the timing that it replaces."""

    leg: Leg
    way: Curve  # q(s) over the share of the way, the leg's path unless that is over the time
    dynamics: PathDynamics  # of the robot with an elastic structure
    planned: Kept[Timing]
    baseline: Kept[Timing]
    iterations: int  # of the last optimum
    seconds: float  # that one plan took
    front: list[tuple[float, float]]  # s and J as the planner believes; empty unless it is asked for


def study_plan(plan: Plan, progress: Callable[[float], None] | None = None) -> list[LegResult]:
    """Plans every leg.

    Args:
        plan: what is asked for.
        progress: is called now and then with the share that is done, 0 to 1.

    Raises:
        ValueError: if something that is asked for does not exist, or a leg is impossible; with the place.
    """
    one_of("--objective", OBJECTIVES, plan.objective)
    return study_legs(plan, legs_of(plan.robot, plan.path, plan.others), progress)


def study_legs(
    plan: Plan, legs: list[Leg], progress: Callable[[float], None] | None = None
) -> list[LegResult]:
    """The same for legs that are known, whatever ``plan.path`` says; arguments and errors likewise."""
    ready: list[list[_Ready]] = []
    results: list[LegResult] = []
    for number, leg in enumerate([*legs, *legs]):
        try:
            if number < len(legs):
                ready.append(_made_ready(plan, leg))
            else:
                allowed = np.inf if plan.may_ring else max(ways[0].usual.run.criterion for ways in ready)
                results.append(_planned(plan, ready[number - len(legs)], max(allowed, STILL)))
        except PathError as error:
            raise PathError(f"{leg.name}: {error}") from error
        if progress:
            progress((number + 1) / (2 * len(legs)))
    return results


@dataclass(frozen=True)
class _Ready:
    """A way with what its motion is measured against."""

    leg: Leg
    dynamics: PathDynamics  # as the planner believes
    elastic: PathDynamics  # of the robot with an elastic structure
    driver: PlantDriver
    usual: Kept[Timing]


def _made_ready(plan: Plan, leg: Leg) -> list[_Ready]:
    """The ways of a leg; one, if it is not free."""
    dynamics, elastic, driver = _of_way(plan, leg)
    require_standing(dynamics, plan.limits)

    def baseline(limits: MotionLimits) -> Timing:
        return (
            quickest(SineSquared, elastic, limits) if leg.is_straight else best_jerk_profile(elastic, limits)
        )

    usual = kept_in_plant(baseline, driver, plan.limits)
    if not plan.is_free:
        return [_Ready(leg, dynamics, elastic, driver, usual)]
    known = plan.robot, plan.payload, leg, plan.limits, plan.dynamics, plan.obstacles
    return [_Ready(way, *_of_way(plan, way), usual) for way in free_legs(*known, plan.sharpness(leg))]


def _of_way(plan: Plan, leg: Leg) -> tuple[PathDynamics, PathDynamics, PlantDriver]:
    dynamics = PathDynamics(plan.robot, plan.payload, leg.path, plan.dynamics)
    elastic = PathDynamics(plan.robot, plan.payload, leg.path, "elastic_structure")
    return dynamics, elastic, PlantDriver(plan.robot, plan.payload, elastic, plan.plant, plan.is_for_law)


def _planned(plan: Plan, ways: list[_Ready], allowed: float) -> LegResult:
    """The leg on the way on which it is quickest in the plant, or with joints that are timed one by one."""
    ready = ways[0]
    kept, best, seconds = _within_limits(plan, ready)
    for other in ways[1:]:
        try:
            found = _within_limits(plan, other, kept.timing.duration if kept.keeps else np.inf)
        except (_SlowerError, PathError):
            continue
        if found[0].keeps or not kept.keeps:
            ready, (kept, best, _) = other, found
    if kept.run.criterion > allowed:
        kept, best = calm_enough(plan, ready, kept, best, allowed)
    timed = _timed(plan, ready.leg, kept.timing.duration if kept.keeps else np.inf)
    if timed is not None:
        found = timed.found.iterations, max(seconds, timed.seconds)
        return LegResult(timed.leg, timed.way, timed.dynamics, timed.kept, ready.usual, *found, [])
    front = _front(plan, ready.dynamics, kept) if plan.objective == "front" else []
    path = ready.leg.path
    return LegResult(ready.leg, path, ready.elastic, kept, ready.usual, best.iterations, seconds, front)


def _timed(plan: Plan, leg: Leg, at_most: float) -> TimedLeg | None:
    """The leg with joints that are timed one by one; None if that is not wanted, not quicker or not clear."""
    if not plan.times_joints:
        return None
    try:
        timed = timed_leg(plan.robot, plan.payload, leg, plan.limits, plan.plant, at_most)
    except PathError:
        return None
    return timed if is_clear(plan.robot, timed.leg.path, plan.obstacles) else None


class _SlowerError(Exception):
    """Another way is quicker."""


def _within_limits(
    plan: Plan, ready: _Ready, at_most: float = np.inf
) -> tuple[Kept[TimeSpline], Optimum, float]:
    """The best motion that keeps the limits in the plant, and how long planning it took at most in s.

    Raises:
        _SlowerError: if it takes longer than ``at_most``, in s: with lower limits it only becomes slower.
    """
    usual, last = ready.usual.timing, []

    def optimal(limits: MotionLimits) -> TimeSpline:
        began = time.perf_counter()
        # Where it does not converge from one, it begins with the other; the usual one has the right duration.
        count, smoother = plan.sharpness(ready.leg)
        starts = [
            rigid_start(plan.robot, plan.payload, ready.leg.path, limits, count),
            as_spline(usual, count),
        ]
        if plan.objective == "energy":
            starts.reverse()
        found = _optimal(plan, ready.dynamics, limits, starts, usual.duration, smoother)
        last.append((found, time.perf_counter() - began))
        if found.motion.duration >= at_most:
            raise _SlowerError
        return found.motion

    kept = kept_in_plant(optimal, ready.driver, plan.limits, varies=True)
    return kept, last[-1][0], max(each for _, each in last)


def calm_enough(
    plan: Plan, ready: _Ready, kept: Kept[TimeSpline], found: Optimum, allowed: float
) -> tuple[Kept[TimeSpline], Optimum]:
    """Gives time or energy away, step by step, until the plant rings no more than allowed.

    Args:
        plan: what is asked for.
        ready: the leg.
        kept: the quickest or most frugal motion within the limits, which rings more.
        found: the same, as the optimiser found it.
        allowed: C of Reiner (2010), eq. (6.1), in m/s.

    Returns:
        The first motion that is calm enough; where none is, the calmest that keeps the limits.
    """
    band = ringing_band(plan.robot, plan.payload, ready.leg.path)
    room = max(0.0, ready.usual.timing.duration / found.motion.duration - 1.0)
    is_frugal = plan.objective == "energy"
    usual = ready.usual.run.energy(plan.recuperation)

    near = found.motion

    def tried(step: float) -> tuple[Kept[TimeSpline], Optimum] | None:
        nonlocal near
        weighed = (0.0, step) if is_frugal else (step * room, None)
        margins = kept.margins
        for _ in range(_ROUNDS):
            try:
                calm = calmed(ready.dynamics, margins, found, band, *weighed, plan.recuperation, near)
            except PathError:
                return None
            if not calm.is_solved:
                return None
            near = calm.motion
            run = ready.driver.run(near)
            if largest_share(run, plan.limits) <= 1.0 + ROUNDING:
                return Kept(calm.motion, run, True, margins), calm
            margins = lowered_there(margins, run, plan.limits)
        return None

    best, too_little = (kept, found), 0.0
    for step in _CALMER_ENERGY if is_frugal else _CALMER:
        calm = tried(step)
        if calm is None:
            continue
        if is_frugal and calm[0].run.energy(plan.recuperation) > usual:
            break  # what is calmer takes still more
        if calm[0].run.criterion < best[0].run.criterion:
            best = calm
        if calm[0].run.criterion > allowed:
            too_little = step
            continue
        enough = step
        for _ in range(_HALVINGS):
            step = math.sqrt(too_little * enough) if is_frugal else 0.5 * (too_little + enough)
            calm = tried(step)
            if calm is not None and calm[0].run.criterion <= allowed:
                best, enough = calm, step
            else:
                too_little = step
        break
    return best


def as_spline(timing: Timing, count: int = COEFFICIENTS) -> TimeSpline:
    """The spline with so many coefficients next to a timing."""
    return fitted(timing.times / timing.duration, timing.rates(timing.times)[0], timing.duration, count)


def _optimal(
    plan: Plan,
    dynamics: PathDynamics,
    limits: MotionLimits,
    starts: list[TimeSpline],
    usual: float,
    sharp: float,
) -> Optimum:
    smoothers = (_SMOOTHER, _SMOOTHER**2) if plan.is_for_law else (sharp, _SMOOTHER)
    for start, smoother in product(starts, smoothers):
        is_frugal = plan.objective == "energy"
        found = optimum(
            dynamics,
            limits,
            start,
            "energy" if is_frugal else "time",
            plan.recuperation,
            usual if is_frugal else None,
            smoother,
        )
        if found.is_solved:
            return found
    raise PathError(f"the optimiser has not converged within {ITERATIONS} iterations")


def _front(plan: Plan, dynamics: PathDynamics, kept: Kept[TimeSpline]) -> list[tuple[float, float]]:
    points = []
    motion = kept.timing
    for share in _FRONT:
        duration = share * kept.timing.duration
        motion = optimum(dynamics, kept.margins, motion, "energy", plan.recuperation, duration).motion
        demand = dynamics.demand(motion.rates(motion.times))
        points.append((duration, energy(demand, motion.times, plan.recuperation)))
    return points

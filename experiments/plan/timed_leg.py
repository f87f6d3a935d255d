"""A free leg whose way and timing are found together: each joint has a time law of its own."""

import time
from dataclasses import dataclass, replace

import numpy as np

from experiments.plan.legs import Leg
from experiments.plan.plant_run import PlantDriver
from experiments.plan.timings import EvenTiming
from experiments.plan.within_limits import ROUNDING, Kept, adapted, largest_share
from robots.description.model import RobotModel
from robots.planning.free_motion import FreeMotion, Sharpness, free_motion
from robots.planning.joint_path import Curve, PathError
from robots.planning.limits import MotionLimits
from robots.planning.path_dynamics import PathDynamics

_SHARP = Sharpness(40, 1e-7, 1.0)  # limits are used up to the edge
_DEGREE = 100  # of a polynomial over the time, which a load may need
_ROUNDS = 14
_TO_AND_FRO = 8  # of them in which limits are raised, too; then they are lowered alone
_GENTLE, _FIRM = 0.4, 1.0  # powers of what is too much


@dataclass(frozen=True)
class TimedLeg:
    """What was found.

    Attributes:
        leg: with q over the share of the time as its path.
        way: q(s) over the share of the way.
        dynamics: of the robot with an elastic structure.
        kept: the motion and how the plant did it.
        found: the same, as the optimiser found it.
        seconds: that one plan took at most.
    """

    leg: Leg
    way: Curve
    dynamics: PathDynamics
    kept: Kept[EvenTiming]
    found: FreeMotion
    seconds: float


def timed_leg(
    robot: RobotModel,
    payload: float,
    leg: Leg,
    limits: MotionLimits,
    plant: RobotModel | None = None,
    at_most: float = np.inf,
) -> TimedLeg:
    """The quickest motion between the ends of a leg that keeps the limits in the plant.

    The rigid arm's optimum is driven by the plant; where the plant exceeds a limit, or leaves some of it, the
    limits of these times are adapted, and the next optimum begins with the last one.

    Args:
        robot: as the planner and the controller know it.
        payload: kg.
        leg: whose ends count.
        limits: of the motion; those of the tool must be infinite.
        plant: what stands in the station, None for the same robot.
        at_most: s, that it may take.

    Raises:
        PathError: if there is none, or the plant keeps the limits in none that was tried.
    """
    start, goal = leg.path.at(np.array([0.0, 1.0]))
    margins, found, longest = limits, None, 0.0
    for number in range(_ROUNDS):
        began = time.perf_counter()
        found = free_motion(robot, payload, start, goal, margins, (), _SHARP, found)
        longest = max(longest, time.perf_counter() - began)
        if not found.is_solved:
            raise PathError("the optimiser has not converged")
        if found.duration >= at_most:
            raise PathError("another motion is quicker")
        path, timing = found.over_time, EvenTiming(found.duration)
        dynamics = PathDynamics(robot, payload, path, "elastic_structure", _DEGREE)
        run = PlantDriver(robot, payload, dynamics, plant).run(timing)
        if largest_share(run, limits) <= 1.0 + ROUNDING:
            kept = Kept(timing, run, True, margins)
            timed = replace(leg, path=path, is_straight=False)
            return TimedLeg(timed, found.way, dynamics, kept, found, longest)
        is_raised = number < _TO_AND_FRO
        demand = dynamics.demand(timing.rates(timing.times))
        margins = adapted(margins, run, demand, limits, _GENTLE if is_raised else _FIRM, is_raised)
    raise PathError("the plant keeps the limits in none of the motions that were tried")

"""A leg whose way does not matter: the quickest one that keeps clear of floor, obstacles and the arm."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from experiments.plan.legs import Leg
from robots.description.model import RobotModel
from robots.measurement_design.clear_ways import ClearWays
from robots.measurement_design.constraints import AdmissibleConfig, AdmissibleConfigurations
from robots.measurement_design.obstacles import Obstacle
from robots.planning.free_motion import free_motion
from robots.planning.joint_path import Curve, PathError, straight_joint_path
from robots.planning.limits import MotionLimits
from robots.planning.optimum import optimum
from robots.planning.path_dynamics import PathDynamics
from robots.planning.rigid_start import rigid_start

_BENT = (1.0, 0.75, 0.5, 0.0)  # shares of the free way's bend that are tried
_AS_QUICK = 1.05  # times the shortest duration, as the planner has it, up to which the plant decides
_TRIED = 2  # ways, there, at most
_PIECES = 60  # in which a way is checked


def free_legs(
    robot: RobotModel,
    payload: float,
    leg: Leg,
    limits: MotionLimits,
    dynamics: str = "elastic_structure",
    obstacles: tuple[Obstacle, ...] = (),
    sharpness: tuple[int, float] = (36, 1.0),
) -> list[Leg]:
    """The leg between the same joint positions on the ways on which it is quickest, the best one first.

    The free way of a rigid arm, three quarters and half of its bend, the straight way of the joints and the
    leg as it is are tried, as far as they are clear. What a planner believes of the quickest, the plant may
    not: it is for that to choose among those that are nearly as quick.

    Args:
        robot: that moves.
        payload: kg.
        leg: that the way may replace.
        limits: of the motion.
        dynamics: of `robots.planning.path_dynamics.DYNAMICS`, that decide.
        obstacles: boxes that the arm keeps clear of.
        sharpness: coefficients of the spline that tells how quick a way is, and times how much of the usual
            weight it is kept smooth: a bend pays only as far as its timing can follow it.

    Raises:
        PathError: if all ways are blocked, with the place, or the limits admit no motion.
    """
    start, goal = leg.path.at(np.array([0.0, 1.0]))
    straight, bent = straight_joint_path(start, goal), free_motion(robot, payload, start, goal, limits).way
    legs = [replace(leg, path=blended(straight, bent, share), is_straight=False) for share in _BENT]
    ways = _clear_ways(robot, obstacles)
    blocked = [_blocked(ways, each.path) for each in (*legs, leg)]
    clear = [each for each, place in zip((*legs, leg), blocked, strict=True) if place is None]
    if not clear:
        raise PathError(
            f"the arm touches itself, the floor or an obstacle at {100.0 * max(filter(None, blocked)):.0f} % "
            "of the way; a target in between may lead it round"
        )
    durations = [_duration(robot, payload, each.path, limits, dynamics, sharpness) for each in clear]
    ranked = [clear[i] for i in np.argsort(durations) if durations[i] <= _AS_QUICK * min(durations)]
    return ranked[:_TRIED]


def is_clear(robot: RobotModel, path: Curve, obstacles: tuple[Obstacle, ...] = ()) -> bool:
    """Whether the arm touches neither itself, the floor nor an obstacle on a path."""
    return _blocked(_clear_ways(robot, obstacles), path) is None


def _clear_ways(robot: RobotModel, obstacles: tuple[Obstacle, ...]) -> ClearWays:
    config = AdmissibleConfig(obstacles=obstacles)
    return ClearWays(robot, AdmissibleConfigurations(robot, config), config.clearance)


def blended(straight: Curve, bent: Curve, share: float) -> Curve:
    """A path with so much of the bend of another one."""
    coefficients = share * bent.coefficients
    coefficients[: len(straight.coefficients)] += (1.0 - share) * straight.coefficients
    return Curve(coefficients)


def _duration(
    robot: RobotModel,
    payload: float,
    path: Curve,
    limits: MotionLimits,
    dynamics: str,
    sharpness: tuple[int, float],
) -> float:
    """In s, of the quickest motion; infinite where none is found."""
    try:
        found = optimum(
            PathDynamics(robot, payload, path, dynamics),
            limits,
            rigid_start(robot, payload, path, limits, sharpness[0]),
            smoother=sharpness[1],
        )
    except PathError:
        return np.inf
    return found.motion.duration if found.is_solved else np.inf


def _blocked(ways: ClearWays, path: Curve) -> float | None:
    """Where a path is blocked, above 0 to 1; None if it is clear."""
    s = np.linspace(0.0, 1.0, _PIECES + 1)
    for number, (before, after) in enumerate(pairwise(path.at(s)), 1):
        if not ways.is_clear(before, after):
            return float(s[number])
    return None

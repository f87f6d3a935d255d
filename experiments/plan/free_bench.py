"""How much quicker a free way is than a straight line in the same limits, and how quick one could be.

``python -m experiments.plan.free_bench [PAIRS] [SEED] [ROBOT...] [--calm]`` draws pairs of poses before the
robot with the tool down, and drives both motions open loop in the plant, with its largest payload. The line
has the sin^2 law with its largest acceleration. ``rigid`` is the quickest motion of a rigid arm along that
line without limits of rates, ``bound`` the time that no motion between the poses can beat. The free motion
may ring, or with ``--calm`` no more than the line.
"""

import argparse
from collections.abc import Iterator
from statistics import median

import numpy as np

from experiments.feedforward.rectangle import working_position
from experiments.plan.legs import Leg, Stop, legs_between
from experiments.plan.study import LegResult, Plan, study_legs
from robots.description.model import RobotModel, load_robot
from robots.kinematics.forward import Kinematics
from robots.planning.joint_path import PathError, require_in_range
from robots.planning.least_time import least_time
from robots.planning.limits import motion_limits
from robots.planning.rigid_start import quickest_rigid

_ROBOTS = ("kr16", "kr210")
# Of the working position's distance from axis 1: how far poses are from it.
_AWAY = np.array([0.15, 0.35, 0.2])
_APART = 0.3  # of that, at least
_TRIES = 100  # for each pair


def drawn_legs(robot: RobotModel, pairs: int, seed: int) -> Iterator[Leg]:
    """Straight lines between drawn poses that the robot can follow.

    Raises:
        PathError: if there is hardly one.
    """
    random = np.random.default_rng(seed)
    home = working_position(robot)
    X = Kinematics(robot).forward(home[None])[0]
    size = float(np.hypot(*X[:2, 3]))
    found = 0
    for _ in range(_TRIES * pairs):
        if found == pairs:
            return
        start, goal = X.copy(), X.copy()
        start[:3, 3] += size * _AWAY * random.uniform(-1.0, 1.0, 3)
        goal[:3, 3] += size * _AWAY * random.uniform(-1.0, 1.0, 3)
        if np.linalg.norm(goal[:3, 3] - start[:3, 3]) < _APART * size:
            continue
        try:
            stops = [Stop("start", start, True), Stop(f"pose {found + 1}", goal, True)]
            (leg,) = legs_between(robot, stops, home)
            require_in_range(robot, leg.path)
        except PathError:
            continue
        found += 1
        yield leg
    if found < pairs:
        raise PathError(f"{robot.name}: hardly a line before the robot is within reach")


def main() -> None:
    """Prints a row for each pair, then the worst and the median of each robot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pairs", nargs="?", type=int, default=8)
    parser.add_argument("seed", nargs="?", type=int, default=1)
    parser.add_argument("robots", nargs="*", default=_ROBOTS)
    parser.add_argument("--calm", action="store_true")
    options = parser.parse_args()
    print("robot, pair: line, free, change; rigid, change; bound, change; C of line, free; limits kept")
    for name in options.robots:
        robot = load_robot(name)
        limits, payload = motion_limits(robot), robot.payload.largest_mass
        plan = Plan(
            robot,
            payload,
            "drawn",
            "time",
            "elastic_structure",
            limits,
            may_ring=not options.calm,
            is_free=True,
        )
        gains = []
        for number, leg in enumerate(drawn_legs(robot, options.pairs, options.seed), 1):
            try:
                (result,) = study_legs(plan, [leg])
            except PathError as error:
                print(f"{name}, {number}: refused, {error}", flush=True)
                continue
            gains.append(_printed(f"{name}, {number}", plan, leg, result))
        if gains:
            print(f"{name}: worst {max(gains):+.1%}, median {median(gains):+.1%} of {len(gains)}", flush=True)


def _printed(name: str, plan: Plan, leg: Leg, result: LegResult) -> float:
    usual, planned = result.baseline, result.planned
    start, goal = leg.path.at(np.array([0.0, 1.0]))
    rigid = float(quickest_rigid(plan.robot, plan.payload, leg.path, plan.limits)[0][-1])
    bound = least_time(plan.robot, plan.payload, start, goal, plan.limits)
    line = usual.timing.duration
    times = [f"{each:.3f} s {each / line - 1.0:+.1%}" for each in (planned.timing.duration, rigid, bound)]
    print(
        f"{name}: {line:.3f} s, {'; '.join(times)}; "
        f"{usual.run.criterion:.4f}, {planned.run.criterion:.4f} m/s; "
        f"{'yes' if planned.keeps and usual.keeps else 'NO'}",
        flush=True,
    )
    return planned.timing.duration / line - 1.0


if __name__ == "__main__":
    main()

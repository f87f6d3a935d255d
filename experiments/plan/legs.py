"""The legs of a path, from rest to rest: edges of a rectangle, a motion of joints, targets of a program."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from experiments.feedforward.rectangle import rectangle, working_position
from robots.configuration.suggestion import did_you_mean
from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.newton_inverse import InverseSolver, inverse_kinematics
from robots.kinematics.analytic_inverse import JointLimitError, UnreachableError
from robots.planning.joint_path import (
    Curve,
    PathError,
    require_in_range,
    smooth_curve,
    straight_joint_path,
)
from robots.programs.program import Target
from robots.programs.read import SUFFIXES, read_program
from systems.reference.segment import Segment, line, weights

RECTANGLE, JOINTS = "rectangle", "joints"
_MOTION = np.deg2rad(
    [-20.0, -20.0, -20.0, 0.0, 0.0, 0.0]
)  # from the stretched arm, Reiner (2010), section 5.3


@dataclass(frozen=True)
class Leg:
    """One motion from rest to rest.

    Attributes:
        name: for people.
        path: q(s) in rad.
        is_straight: whether the tool goes along a straight line, or the joints in proportion.
    """

    name: str
    path: Curve
    is_straight: bool


def legs_of(robot: RobotModel, path: str) -> list[Leg]:
    """The legs of a path.

    Args:
        robot: that moves.
        path: ``rectangle``, ``joints`` or a program or table of targets, at each of which the tool rests.

    Raises:
        ValueError: if there is no such path, or the robot cannot follow it; with the place.
    """
    if path == JOINTS:
        legs = [Leg("axes 1-3", straight_joint_path(np.zeros(NUM_JOINTS), _MOTION), False)]
    elif path == RECTANGLE:
        home = working_position(robot)
        poses = [corner.pose() for corner in rectangle(robot, home)]
        legs = legs_between(robot, [(f"corner {i}", pose) for i, pose in enumerate(poses, 1)], home)
    elif path.lower().endswith(SUFFIXES):
        legs = _program_legs(robot, path)
    else:
        raise ValueError(
            f"--path must be {RECTANGLE}, {JOINTS} or a file that ends in {', '.join(SUFFIXES)}, got '{path}'"
            f"{did_you_mean(path, (RECTANGLE, JOINTS))}"
        )
    for leg in legs:
        try:
            require_in_range(robot, leg.path)
        except PathError as error:
            raise PathError(f"{leg.name}: {error}") from error
    return legs


def _program_legs(robot: RobotModel, path: str) -> list[Leg]:
    program = read_program(path)
    if len(program.targets) < 2:
        raise ValueError(f"{path}: a motion needs at least two targets, got {len(program.targets)}")
    first = program.targets[0]
    home = first.q if first.has_joints else working_position(robot)
    named = [(f"{path}, line {each.line}", _place(each)) for each in program.targets]
    return legs_between(robot, named, home)


def _place(target: Target) -> np.ndarray:
    if target.has_joints:
        return target.q
    X_tool = np.eye(4) if target.tool is None else target.tool.X
    return target.base.X @ target.X_BT @ np.linalg.inv(X_tool)


def legs_between(robot: RobotModel, places: list[tuple[str, np.ndarray]], home: np.ndarray) -> list[Leg]:
    """Legs between places: poses (4, 4), or joint positions (6,) in rad."""
    inverse, legs, q = inverse_kinematics(robot), [], home
    is_first = True
    for (before, start), (name, goal) in pairwise(places):
        if is_first:
            q = start if start.ndim == 1 else _reached(inverse, start, q, before)
            is_first = False
        if goal.ndim == 1 or start.ndim == 1:
            end = goal if goal.ndim == 1 else _reached(inverse, goal, q, name)
            path, is_straight = straight_joint_path(q, end), False
        else:
            path, is_straight = _line_path(inverse, line(start, goal), q, name), True
        legs.append(Leg(f"to {name}", path, is_straight))
        q = path.at(np.array([1.0]))[0]
    return legs


def _line_path(inverse: InverseSolver, segment: Segment, q_start: np.ndarray, name: str) -> Curve:
    def joints(s: np.ndarray) -> np.ndarray:
        rows, near = [], q_start
        for each in s:
            near = _reached(
                inverse, _pose(segment, float(each)), near, f"{name}, {100.0 * each:.0f} % of the way"
            )
            rows.append(near)
        return np.array(rows)

    try:
        return smooth_curve(joints, "the motion of the joints")
    except PathError as error:
        raise PathError(f"to {name}: {error}") from error


def _pose(segment: Segment, s: float) -> np.ndarray:
    u = segment.angle * s
    of_pose, _, _ = weights(segment.angle, s, 0.0, 0.0, np.sin(u), np.cos(u))
    return (np.array(of_pose) @ segment.pose).reshape(4, 4)


def _reached(inverse: InverseSolver, X_WE: np.ndarray, near: np.ndarray, place: str) -> np.ndarray:
    try:
        return inverse.nearest(X_WE, near)
    except (UnreachableError, JointLimitError) as error:
        raise PathError(f"{place}: {error}") from error

"""The legs of a path, from rest to rest: edges of a rectangle, a motion of joints, targets of a program."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from experiments.feedforward.rectangle import reached_size, rectangle, working_position
from robots.configuration.suggestion import did_you_mean
from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.compliant_kinematics import CompliantKinematics, controller_kinematics
from robots.dynamics.newton_inverse import InverseSolver, inverse_kinematics
from robots.kinematics.analytic_inverse import JointLimitError, UnreachableError
from robots.kinematics.forward import Kinematics
from robots.planning.joint_path import (
    Curve,
    PathError,
    require_in_range,
    require_motion,
    smooth_curve,
    straight_joint_path,
)
from robots.programs.program import Move, Program, Target
from robots.programs.read import SUFFIXES, read_program
from systems.reference.segment import Segment, line, weights

RECTANGLE, JOINTS = "rectangle", "joints"
_MOTION = np.deg2rad(
    [-20.0, -20.0, -20.0, 0.0, 0.0, 0.0]
)  # from zero, where his KUKA is stretched, Reiner (2010), section 5.3


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


@dataclass(frozen=True)
class Stop:
    """A place at which the robot rests.

    Attributes:
        name: for people.
        place: pose of the tool in the world (4, 4), or joint positions in rad (6,).
        is_straight: whether the tool goes there along a straight line, or the joints in proportion.
    """

    name: str
    place: np.ndarray
    is_straight: bool


def legs_of(robot: RobotModel, path: str, others: Sequence[str] = ()) -> list[Leg]:
    """The legs of a path.

    Args:
        robot: that moves.
        path: ``rectangle``, ``joints`` or a program or table of targets, at each of which the tool rests.
        others: files that declare tools, frames and, in KRL, targets of the program.

    Raises:
        ValueError: if there is no such path, or the robot cannot follow it; with the place.
    """
    if others and path in (RECTANGLE, JOINTS):
        raise ValueError(f"--with counts for a program only, --path is {path}")
    if path == JOINTS:
        legs = [Leg("axes 1-3", straight_joint_path(np.zeros(NUM_JOINTS), _MOTION), False)]
    elif path == RECTANGLE:
        home = working_position(robot)
        poses = [corner.pose() for corner in rectangle(robot, home, reached_size(robot, home))]
        legs = legs_between(robot, [Stop(f"corner {i}", pose, True) for i, pose in enumerate(poses, 1)], home)
    elif path.lower().endswith(SUFFIXES):
        legs = _program_legs(robot, path, others)
    else:
        raise ValueError(
            f"--path must be {RECTANGLE}, {JOINTS} or a file that ends in {', '.join(SUFFIXES)}, got '{path}'"
            f"{did_you_mean(path, (RECTANGLE, JOINTS))}"
        )
    for leg in legs:
        try:
            require_in_range(robot, leg.path)
            require_motion(leg.path)
        except PathError as error:
            raise PathError(f"{leg.name}: {error}") from error
    return legs


def _program_legs(robot: RobotModel, path: str, others: Sequence[str]) -> list[Leg]:
    program = read_program(path, others)
    if not program.moves:
        raise ValueError(
            f"{path}: no instruction moves, and what is declared has no order; give the program that moves "
            "to it, or a table"
        )
    stops = [_stop(program, move) for move in program.moves]
    if len(stops) < 2:
        raise ValueError(f"{path}: a motion needs at least two targets, got {len(stops)}")
    first = stops[0].place
    return legs_between(robot, stops, first if first.ndim == 1 else working_position(robot))


def _stop(program: Program, move: Move) -> Stop:
    """Where a move ends; a move that is left out would be another way in space."""
    where = f"{program.name}, line {move.line}"
    if move.why_not or move.target is None:
        raise ValueError(f"{where}: {move.why_not}")
    place = _place(move.target)
    if not np.isfinite(place).all():
        raise ValueError(f"{where}: a number is infinite")
    return Stop(where, place, move.is_straight)


def _place(target: Target) -> np.ndarray:
    if target.has_joints:
        return target.q
    X_tool = np.eye(4) if target.tool is None else target.tool.X
    return target.base.X @ target.X_BT @ np.linalg.inv(X_tool)


def legs_between(robot: RobotModel, stops: list[Stop], home: np.ndarray) -> list[Leg]:
    """Legs between stops, the first of which is where the robot begins.

    Args:
        robot: that moves.
        stops: two or more.
        home: joint positions in rad, shape (6,), near which the robot begins if it does so at a pose.

    Raises:
        PathError: if a stop or a line to one cannot be reached; with its name.
    """
    inverse, kinematics, legs = inverse_kinematics(robot), controller_kinematics(robot), []
    q = _joints(inverse, stops[0], home)
    for before, stop in pairwise(stops):
        if stop.is_straight:
            start, goal = (_pose_of(kinematics, each.place) for each in (before, stop))
            path = _line_path(inverse, line(start, goal), q, stop.name)
        else:
            path = _joint_path(q, _joints(inverse, stop, q), stop.name)
        legs.append(Leg(f"to {stop.name}", path, stop.is_straight))
        q = path.at(np.array([1.0]))[0]
    return legs


def _joint_path(start: np.ndarray, goal: np.ndarray, name: str) -> Curve:
    try:
        return straight_joint_path(start, goal)
    except PathError as error:
        raise PathError(f"to {name}: {error}") from error


def _pose_of(kinematics: Kinematics | CompliantKinematics, place: np.ndarray) -> np.ndarray:
    return kinematics.forward(place) if place.ndim == 1 else place


def _joints(inverse: InverseSolver, stop: Stop, near: np.ndarray) -> np.ndarray:
    return stop.place if stop.place.ndim == 1 else _reached(inverse, stop.place, near, stop.name)


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

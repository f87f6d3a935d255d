"""Poses of a robot with wrong geometry, and how the tool moves with every parameter, for one and for many.

The model is that of `robots.kinematics.error_kinematics`. What does not depend on the joints is worked out
once for a value of the parameters; a configuration then costs nine small products of matrices.
"""

from typing import NamedTuple

import numpy as np

from robots.description.error_parameters import (
    AFTER,
    BEFORE,
    NUM_PARAMETERS,
    OFFSET,
    OFFSETS,
    SHIFT,
    TOOL,
    error_parameters,
)
from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.elastic_structure import tilting_axes

_EYE = np.eye(3)
# v @ _SKEW, as a 3 x 3 matrix, is the cross product with v.
_SKEW = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _SKEW[_i, _k, _j], _SKEW[_i, _j, _k] = 1.0, -1.0
_SKEW = _SKEW.reshape(3, 9)


def skew(vectors: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) whose product with w is the cross product of the vectors (..., 3) with w."""
    return (vectors @ _SKEW).reshape(*vectors.shape, 3)


class Constants(NamedTuple):
    """What a value of the parameters makes of the robot."""

    p: np.ndarray  # (48,)
    along: np.ndarray  # (6, 4, 4), the pose of a link in the one before is along + sin sine + cos cosine
    sine: np.ndarray
    cosine: np.ndarray
    tool: np.ndarray  # (4, 4), in the last link
    turn: np.ndarray  # (7, 3, k), axes of turning columns in the frame that they belong to
    lever: np.ndarray  # (7, 3 k, 3), what the way to the tool makes of them
    way: np.ndarray  # (7, 3, k), the rest


class Arm(NamedTuple):
    """An arm in n configurations."""

    X_WE: np.ndarray  # (n, 4, 4)
    frames: np.ndarray  # (n, 7, 4, 4), the world and the six links
    columns: np.ndarray  # (n, 6, 18 + g): joints, two tilts of each bearing, the chosen parameters


class ArmGeometry:
    """Poses and columns at any value of the 48 error parameters."""

    def __init__(self, robot: RobotModel, chosen: np.ndarray) -> None:
        """Sorts the columns by the link that carries them.

        Args:
            robot: the nominal robot.
            chosen: indices of the g error parameters that get a column.
        """
        self._parameters = error_parameters(robot)
        placements = [robot.base, *(joint.placement for joint in robot.joints), robot.tool]
        self._l = [np.asarray(placement.translation, dtype=float) for placement in placements]
        # The tool has no rotation but its angles: its errors are added to them.
        self._R = [placement.pose().rotation().matrix() for placement in placements[:-1]] + [_EYE]
        self._nominal = np.zeros(NUM_PARAMETERS)
        self._nominal[self._entries_of(TOOL, BEFORE)] = np.deg2rad(robot.tool.zyx_deg)
        axes = robot.axes
        outer = axes[:, :, None] * axes[:, None, :]
        self._joint_turns = outer, skew(axes), _EYE - outer
        of_parameters = _EYE[[entry.axis for entry in self._parameters]]
        outer = of_parameters[:, :, None] * of_parameters[:, None, :]
        self._turns = outer, skew(of_parameters), _EYE - outer
        self._sort(robot, chosen.tolist())

    def _entries_of(self, body: int, kind: str) -> list[int]:
        return [i for i, e in enumerate(self._parameters) if (e.body, e.kind) == (body, kind)]

    def _sort(self, robot: RobotModel, chosen: list[int]) -> None:
        """Gives every column a frame, a slot in it and, where it is constant, its axis."""
        columns = {i: 18 + k for k, i in enumerate(chosen)}
        self.num_columns = 18 + len(chosen)
        self._bodies = [  # of each body its shifts, turns before and turns after: number, axis, column
            [
                [(i, self._parameters[i].axis, columns.get(i, -1)) for i in self._entries_of(body, kind)]
                for kind in (SHIFT, BEFORE, AFTER)
            ]
            for body in range(TOOL + 1)
        ]
        self._axes = np.zeros((self.num_columns, 3))
        self._is_shift = np.zeros(self.num_columns, dtype=bool)
        frame_of = np.zeros(self.num_columns, dtype=int)
        for i, joint in enumerate(robot.joints):
            own = [i, 6 + 2 * i, 7 + 2 * i]
            frame_of[own] = i + 1
            self._axes[own] = [robot.axes[i], *tilting_axes(joint.axis)]
        for i, column in columns.items():
            entry = self._parameters[i]
            is_behind = entry.kind in (OFFSET, AFTER)
            frame_of[column] = entry.body if is_behind else max(entry.body - 1, 0)
            self._is_shift[column] = entry.kind == SHIFT
            if entry.kind == OFFSET:
                self._axes[column] = robot.axes[entry.body - 1]
        self._width = int(np.bincount(frame_of).max())
        slots = np.zeros(self.num_columns, dtype=int)
        for frame in range(NUM_JOINTS + 1):
            own = np.flatnonzero(frame_of == frame)
            slots[own] = np.arange(len(own))
        self._take = frame_of * self._width + slots

    def constants(self, p: np.ndarray) -> Constants:
        """What does not depend on the joints.

        Args:
            p: all error parameters, shape (48,).
        """
        angles = (p + self._nominal)[:, None, None]
        along, across, beside = self._turns
        turns = along + np.sin(angles) * across + np.cos(angles) * beside
        axes, points = self._axes.copy(), np.zeros((self.num_columns, 3))
        between = np.zeros((TOOL, 4, 4))
        between[:, 3, 3] = 1.0
        R, origin = _EYE, np.zeros(3)
        for body, (shifts, before, after) in enumerate(self._bodies):
            for _, axis, column in shifts:
                if column >= 0:
                    axes[column] = R[:, axis]
            origin = origin + R.dot(self._l[body] + p[[i for i, *_ in shifts]])
            R = R.dot(self._R[body])
            for i, axis, column in before:
                if column >= 0:
                    axes[column], points[column] = R[:, axis], origin
                R = R.dot(turns[i])
            if body == 0:
                continue
            between[body - 1, :3, :3], between[body - 1, :3, 3] = R, origin
            R, origin = _EYE, np.zeros(3)
            for i, axis, column in after:
                if column >= 0:
                    axes[column] = R[:, axis]
                R = R.dot(turns[i])
        return self._arranged(p, between, axes, points)

    def _arranged(
        self, p: np.ndarray, between: np.ndarray, axes: np.ndarray, points: np.ndarray
    ) -> Constants:
        """Puts poses between the links, and axes and points of the columns, where `arm` wants them."""
        parts = np.zeros((3, NUM_JOINTS, 4, 4))
        parts[:, :, :3, :3] = self._joint_turns
        parts[0, :, 3, 3] = 1.0
        along, sine, cosine = between[:-1] @ parts
        number = (NUM_JOINTS + 1) * self._width
        turn, way, lever = np.zeros((number, 3)), np.zeros((number, 3)), np.zeros((number, 3, 3))
        cross = skew(axes)
        cross[self._is_shift] = 0.0
        turn[self._take] = np.where(self._is_shift[:, None], 0.0, axes)
        lever[self._take] = cross
        way[self._take] = np.where(self._is_shift[:, None], axes, -(cross @ points[..., None])[..., 0])
        shape = NUM_JOINTS + 1, self._width
        lever = lever.reshape(*shape, 3, 3).swapaxes(1, 2).reshape(NUM_JOINTS + 1, -1, 3)
        turn, way = (part.reshape(*shape, 3).swapaxes(1, 2).copy() for part in (turn, way))
        return Constants(p.copy(), along, sine, cosine, between[-1], turn, lever, way)

    def arm(self, constants: Constants, q: np.ndarray) -> Arm:
        """Poses and columns.

        Args:
            constants: of a value of the parameters.
            q: joints behind the gears in rad, shape (n, 6).
        """
        n, c = len(q), constants
        angles = q + c.p[OFFSETS]
        steps = (
            c.along + np.sin(angles)[..., None, None] * c.sine + np.cos(angles)[..., None, None] * c.cosine
        )
        frames = np.empty((n, NUM_JOINTS + 1, 4, 4))
        frames[:, 0] = np.eye(4)
        T = frames[:, 0]
        for i in range(NUM_JOINTS):
            T = T @ steps[:, i]
            frames[:, i + 1] = T
        X_WE = T @ c.tool
        R = frames[..., :3, :3]
        to_tip = X_WE[:, None, :3, 3] - frames[..., :3, 3]
        to_tip = (to_tip[..., None, :] @ R).swapaxes(-1, -2)  # R^T v as a column
        local = np.empty((n, NUM_JOINTS + 1, 3, 2 * self._width))
        local[..., : self._width] = c.turn
        local[..., self._width :] = (c.lever @ to_tip).reshape(n, NUM_JOINTS + 1, 3, self._width) + c.way
        world = R @ local
        columns = np.empty((n, 6, self.num_columns))
        for rows, part in (
            (slice(0, 3), world[..., : self._width]),
            (slice(3, 6), world[..., self._width :]),
        ):
            columns[:, rows] = part.swapaxes(1, 2).reshape(n, 3, -1)[:, :, self._take]
        return Arm(X_WE, frames, columns)

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
    SHIFT,
    TOOL,
    error_parameters,
)
from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.elastic_structure import tilting_axes
from systems.estimation import kernels
from systems.estimation.kernels.arrays import SHIFTS, TURNS_BEFORE, TURNS_BEHIND, Constants, Drawing

_EYE = np.eye(3)
_DOES = {SHIFT: SHIFTS, BEFORE: TURNS_BEFORE, AFTER: TURNS_BEHIND}


class Arm(NamedTuple):
    """An arm in n configurations."""

    X_WE: np.ndarray  # (n, 4, 4)
    frames: np.ndarray  # (n, 7, 4, 4), the world and the six links
    columns: np.ndarray  # (n, 6, 18 + g): joints, two tilts of each bearing, the chosen parameters


class ArmGeometry:
    """Poses and columns at any value of the 48 error parameters."""

    def __init__(self, robot: RobotModel, chosen: np.ndarray) -> None:
        """Sorts parameters by the body and columns by the link that carries them.

        Args:
            robot: the nominal robot.
            chosen: indices of the g error parameters that get a column.
        """
        parameters = error_parameters(robot)
        columns = {i: 18 + k for k, i in enumerate(chosen.tolist())}
        self.num_columns = 18 + len(columns)
        entries = [
            (entry.body, _DOES[entry.kind], i, entry.axis, columns.get(i, -1))
            for i, entry in enumerate(parameters)
            if entry.kind != OFFSET
        ]
        axes = np.zeros((self.num_columns, 3))
        is_shift = np.zeros(self.num_columns, dtype=bool)
        frame = np.zeros(self.num_columns, dtype=int)
        for i, joint in enumerate(robot.joints):
            own = [i, 6 + 2 * i, 7 + 2 * i]
            frame[own] = i + 1
            axes[own] = [robot.axes[i], *tilting_axes(joint.axis)]
        for i, column in columns.items():
            entry = parameters[i]
            is_behind = entry.kind in (OFFSET, AFTER)
            frame[column] = entry.body if is_behind else max(entry.body - 1, 0)
            is_shift[column] = entry.kind == SHIFT
            if entry.kind == OFFSET:
                axes[column] = robot.axes[entry.body - 1]
        placements = [robot.base, *(joint.placement for joint in robot.joints), robot.tool]
        # The tool has no rotation but its angles: its errors are added to them.
        rotation = [placement.pose().rotation().matrix() for placement in placements[:-1]] + [_EYE]
        nominal = np.zeros(NUM_PARAMETERS)
        tool = [i for i, entry in enumerate(parameters) if (entry.body, entry.kind) == (TOOL, BEFORE)]
        nominal[tool] = np.deg2rad(robot.tool.zyx_deg)
        along = robot.axes[:, :, None] * robot.axes[:, None, :]
        across = np.cross(robot.axes[:, None, :], _EYE).swapaxes(1, 2)  # the cross product with the axis
        self._chosen = chosen
        self._drawing = Drawing(
            # In the order in which they act; that of the parameters where several act at once.
            entries=np.array([(i, body, does, axis, c) for body, does, i, axis, c in sorted(entries)]),
            translation=np.array([placement.translation for placement in placements], dtype=float),
            rotation=np.array(rotation),
            nominal=nominal,
            joint_turns=np.array([along, across, _EYE - along]),
            axes=axes,
            is_shift=is_shift,
            frame=frame,
        )

    def constants(self, p: np.ndarray) -> Constants:
        """What does not depend on the joints.

        Args:
            p: all error parameters, shape (48,).
        """
        number = self.num_columns
        along, sine, cosine = np.zeros((3, NUM_JOINTS, 3, 4))
        turn, way = np.zeros((2, number, 3))
        p = np.array(p, dtype=float)
        constants = Constants(
            p, p[self._chosen], along, sine, cosine, np.zeros((3, 4)), turn, way, self._drawing.frame
        )
        kernels.geometry.fill_constants(self._drawing, constants)
        return constants

    def arm(self, constants: Constants, q: np.ndarray) -> Arm:
        """Poses and columns.

        Args:
            constants: of a value of the parameters.
            q: joints behind the gears in rad, shape (n, 6).
        """
        n = len(q)
        X_WE, frames = np.empty((n, 4, 4)), np.empty((n, NUM_JOINTS + 1, 4, 4))
        columns = np.empty((n, 6, self.num_columns))
        kernels.geometry.place_all(constants, q, X_WE, frames, columns)
        return Arm(X_WE, frames, columns)

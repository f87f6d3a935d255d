"""What a camera system sees of the tool after it has been moved."""

from collections.abc import Sequence

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context
from scipy.spatial.transform import Rotation

from systems.cell.events.station_events import CameraShift, StationEvent, of_kind
from systems.sampled_system import SampledSystem


class DisplacedView(SampledSystem):
    """Stands before a camera that believes it is where it was.

    Ports:
        in  ``X_WE``  RigidTransform, the true tool in the world
        out ``X_WE``  RigidTransform, the tool as it appears
    """

    def __init__(self, events: Sequence[StationEvent]) -> None:
        """Takes the camera's moves from the events."""
        super().__init__()
        self._moves = []
        moved = RigidTransform()
        for event in of_kind(events, CameraShift):
            R = Rotation.from_rotvec(np.deg2rad(event.turn_deg)).as_matrix()
            moved = RigidTransform(RotationMatrix(R), 1e-3 * np.asarray(event.shift_mm)) @ moved
            self._moves.append((event.at, moved.inverse()))
        self._X_WE = self.DeclareAbstractInputPort("X_WE", Value(RigidTransform()))
        self.DeclareAbstractOutputPort(
            "X_WE",
            lambda: Value(RigidTransform()),
            self._calc,
            {self.time_ticket(), self._X_WE.ticket()},
        )

    def _calc(self, context: Context, output) -> None:
        X_WE = self._X_WE.Eval(context)
        passed = [appears for at, appears in self._moves if at <= context.get_time()]
        output.set_value(passed[-1] @ X_WE if passed else X_WE)

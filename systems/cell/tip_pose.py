"""The true pose of the tool, computed from the state of a plant."""

from collections.abc import Callable

from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from robots.dynamics.plant import PlantRobot
from systems.sampled_system import SampledSystem


class TipPose(SampledSystem):
    """Forward kinematics of a plant, with its deflections and geometric errors.

    Ports:
        in  ``state``  state of the plant
        out ``X_WE``   RigidTransform, the tool in the world
    """

    def __init__(self, robot: PlantRobot, changes: Callable[[Context, float], None] | None = None) -> None:
        """Declares the ports.

        Args:
            robot: of a finalized plant.
            changes: puts the geometry of a time in s into a context of the plant; None if it never changes.
        """
        super().__init__()
        self._changes = changes
        self._robot, self._num_positions = robot, robot.plant.num_positions()
        # Scratch memory only: overwritten before every use, so it carries nothing from call to call.
        self._scratch = robot.plant.CreateDefaultContext()
        self._state = self.DeclareVectorInputPort("state", robot.plant.num_multibody_states())
        self.DeclareAbstractOutputPort(
            "X_WE",
            lambda: Value(RigidTransform()),
            self._calc,
            {self._state.ticket(), self.time_ticket()} if changes else {self._state.ticket()},
        )

    def _calc(self, context: Context, output) -> None:
        if self._changes:
            self._changes(self._scratch, context.get_time())
        self._robot.plant.SetPositions(self._scratch, self._state.Eval(context)[: self._num_positions])
        output.set_value(self._robot.tool.CalcPoseInWorld(self._scratch))

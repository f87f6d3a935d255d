"""The true pose of the tool, computed from the state of a plant."""

from collections.abc import Callable

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, LeafSystem

from robots.dynamics.plant import PlantRobot
from systems.sampled_system import SampledSystem


class Tip:
    """Forward kinematics of a plant, with its deflections and geometric errors."""

    def __init__(self, robot: PlantRobot, changes: Callable[[Context, float], None] | None = None) -> None:
        """Makes room for a state.

        Args:
            robot: of a finalized plant.
            changes: puts the geometry of a time in s into a context of the plant; None if it never changes.
        """
        self.state_size = robot.plant.num_multibody_states()
        self.is_constant = changes is None
        self._changes, self._plant, self._tool = changes, robot.plant, robot.tool
        self._num_positions = robot.plant.num_positions()
        # Scratch memory only: overwritten before every use, so it carries nothing from call to call.
        self._scratch = robot.plant.CreateDefaultContext()

    def pose(self, time: float, state: np.ndarray) -> RigidTransform:
        """The tool in the world, X_WE, at a time in s in a state of the plant, (state_size,)."""
        if self._changes:
            self._changes(self._scratch, time)
        self._plant.SetPositions(self._scratch, state[: self._num_positions])
        return self._tool.CalcPoseInWorld(self._scratch)


class TipPose(SampledSystem):
    """Where the tool is, for what looks at it.

    Ports:
        in  ``state``  state of the plant
        out ``X_WE``   RigidTransform, the tool in the world
    """

    def __init__(self, tip: Tip) -> None:
        """Declares the ports."""
        super().__init__()
        self.pose = declare_tip(self, tip)


def declare_tip(system: LeafSystem, tip: Tip) -> Callable[[Context], RigidTransform]:
    """Declares the ports of `TipPose` on a system.

    Returns:
        What its port ``X_WE`` says in a context, without asking Drake for it.
    """
    state = system.DeclareVectorInputPort("state", tip.state_size)

    def pose(context: Context) -> RigidTransform:
        return tip.pose(0.0 if tip.is_constant else context.get_time(), state.Eval(context))

    system.DeclareAbstractOutputPort(
        "X_WE",
        lambda: Value(RigidTransform()),
        lambda context, output: output.set_value(pose(context)),
        {state.ticket()} if tip.is_constant else {state.ticket(), system.time_ticket()},
    )
    return pose

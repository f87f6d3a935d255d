"""The geometry of a true robot that changes while it works: slipped joints, a displaced tool, warm links."""

from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import FixedOffsetFrame
from pydrake.systems.framework import Context
from scipy.spatial.transform import Rotation

from robots.description.model import NUM_JOINTS
from robots.dynamics.plant import PlantRobot
from systems.cell.events.station_events import JointZeroShift, StationEvent, ToolShift, of_kind

_HOUR = 3600.0  # s


class TrueGeometry:
    """Where the frames of a robot are at a time. They are parameters in the context of its plant."""

    def __init__(
        self, robot: PlantRobot, events: Sequence[StationEvent] = (), growth_ppm_per_hour: float = 0.0
    ) -> None:
        """Reads the frames of a finalized plant.

        Args:
            robot: the true robot at the start.
            events: of which tool and joint zeros are heard.
            growth_ppm_per_hour: how much longer the links, and the tool, become in an hour.

        Raises:
            ValueError: if the growth is not finite.
        """
        if not np.isfinite(growth_ppm_per_hour):
            raise ValueError(f"growth of the links must be finite, got {growth_ppm_per_hour} ppm/h")
        self._growth = 1e-6 * growth_ppm_per_hour / _HOUR
        self._joints = of_kind(events, JointZeroShift)
        self._tools = of_kind(events, ToolShift)
        plant = robot.plant
        self._frames: list[FixedOffsetFrame] = [
            plant.GetFrameByName(f"socket_{i + 1}") for i in range(NUM_JOINTS)
        ] + [robot.tool]  # type: ignore[list-item]
        context = plant.CreateDefaultContext()
        self._at_start = [frame.GetPoseInParentFrame(context) for frame in self._frames]
        self._axes = [motor.revolute_axis() for motor in robot.motors]

    @property
    def change_times(self) -> list[float]:
        """When the geometry changes by leaps, in s."""
        return sorted(event.at for event in (*self._joints, *self._tools))

    @property
    def is_constant(self) -> bool:
        """Whether nothing ever changes."""
        return not (self._joints or self._tools or self._growth)

    def apply(self, context: Context, time: float) -> None:
        """Puts the frames where they are at a time in s, in a context of the plant."""
        turns = np.zeros(NUM_JOINTS)
        for event in self._joints:
            if event.at <= time:
                turns += np.deg2rad(event.shift_deg)
        shifts = [
            RigidTransform(RotationMatrix(Rotation.from_rotvec(turn * axis).as_matrix()), np.zeros(3))
            for turn, axis in zip(turns, self._axes, strict=True)
        ]
        tool = RigidTransform()
        for event in self._tools:
            if event.at <= time:
                R = Rotation.from_rotvec(np.deg2rad(event.turn_deg)).as_matrix()
                tool = tool @ RigidTransform(RotationMatrix(R), 1e-3 * np.asarray(event.shift_mm))
        for frame, X_PF, shift in zip(self._frames, self._at_start, [*shifts, tool], strict=True):
            warm = RigidTransform(X_PF.rotation(), (1.0 + self._growth * time) * X_PF.translation())
            frame.SetPoseInParentFrame(context, warm @ shift)

    def tool_poses(self, robot: PlantRobot, times: np.ndarray, states: np.ndarray) -> np.ndarray:
        """Poses of the tool in the world, (n, 4, 4), at times (n,) in s and plant states (n, states)."""
        context, poses = robot.plant.CreateDefaultContext(), np.empty((len(states), 4, 4))
        for pose, time, state in zip(poses, times, states, strict=True):
            self.apply(context, time)
            robot.plant.SetPositionsAndVelocities(context, state)
            pose[:] = robot.tool.CalcPoseInWorld(context).GetAsMatrix4()
        return poses

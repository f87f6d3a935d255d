"""A real robot cell as a diagram with the same ports as a simulated station."""

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import AbstractParameterIndex, Context, LeafSystem

from robots.description.model import NUM_JOINTS
from systems.samples import JointSample, PoseSample


class HardwareStation(LeafSystem):
    """Stands for a controller and a camera at the other end of a wire.

    Ports, the same as those of a simulated cell:
        in  ``position_command``  vector 6 in rad
        in  ``velocity_command``  vector 6 in rad/s
        out ``joint_sample``      JointSample
        out ``pose_sample``       PoseSample

    It touches no socket. Whoever holds the wire puts in what was received with `receive` and takes out what
    is to be sent with `command`.
    """

    def __init__(self) -> None:
        super().__init__()
        self._commands = [
            self.DeclareVectorInputPort(name, NUM_JOINTS) for name in ("position_command", "velocity_command")
        ]
        nothing = JointSample(), PoseSample()
        # One parameter for both samples: what depends on either is told once.
        index = AbstractParameterIndex(self.DeclareAbstractParameter(Value[object](nothing)))
        self._received = index
        for part, (name, empty) in enumerate(zip(("joint_sample", "pose_sample"), nothing, strict=True)):
            self.DeclareAbstractOutputPort(
                name,
                lambda empty=empty: Value(empty),
                lambda context, output, part=part: output.set_value(
                    context.get_abstract_parameter(index).get_value()[part]
                ),
                {self.abstract_parameter_ticket(index)},
            )

    def receive(self, root_context: Context, joints: JointSample, pose: PoseSample) -> None:
        """Makes these the newest samples."""
        context = self.GetMyMutableContextFromRoot(root_context)
        context.get_mutable_abstract_parameter(self._received).set_value((joints, pose))

    def command(self, root_context: Context) -> tuple[np.ndarray, np.ndarray]:
        """The position (6,) in rad and velocity (6,) in rad/s that the servo commands now."""
        context = self.GetMyContextFromRoot(root_context)
        position, velocity = (port.Eval(context) for port in self._commands)
        return position, velocity

"""A real robot cell as a diagram with the same ports as a simulated station."""

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import (
    AbstractParameterIndex,
    BasicVector,
    Context,
    LeafSystem,
    NumericParameterIndex,
)

from robots.description.model import NUM_JOINTS
from systems.samples import JointSample, PersonSample, PoseSample

_NOBODY = PersonSample()  # and not trusted


class HardwareStation(LeafSystem):
    """Stands for a controller and a camera at the other end of a wire.

    Ports, the same as those of a simulated cell:
        in  ``position_command``  vector 6 in rad
        in  ``velocity_command``  vector 6 in rad/s
        out ``joint_sample``      JointSample
        out ``pose_sample``       PoseSample
    and, where another process looks for people:
        out ``person_sample``     PersonSample
        out ``acknowledge``       vector 1: 1 while somebody lets the robot go on after a stop, else 0

    It touches no socket. Whoever holds the wire puts in what was received with `receive` and takes out what
    is to be sent with `command`.
    """

    def __init__(self, has_people: bool = False) -> None:
        """``has_people``: whether somebody looks for people."""
        super().__init__()
        self._commands = [
            self.DeclareVectorInputPort(name, NUM_JOINTS) for name in ("position_command", "velocity_command")
        ]
        nothing = JointSample(), PoseSample(), PersonSample()
        # One parameter for all samples: what depends on any is told once.
        index = AbstractParameterIndex(self.DeclareAbstractParameter(Value[object](nothing)))
        self._received = index
        models = Value(nothing[0]), Value(nothing[1]), Value[object](nothing[2])
        names = ("joint_sample", "pose_sample", "person_sample")[: 3 if has_people else 2]
        for part, name in enumerate(names):
            self.DeclareAbstractOutputPort(
                name,
                lambda model=models[part]: model.Clone(),
                lambda context, output, part=part: output.set_value(
                    context.get_abstract_parameter(index).get_value()[part]
                ),
                {self.abstract_parameter_ticket(index)},
            )
        if has_people:
            self._acknowledged = NumericParameterIndex(self.DeclareNumericParameter(BasicVector(np.zeros(1))))
            ticket = self.numeric_parameter_ticket(self._acknowledged)
            self.DeclareVectorOutputPort("acknowledge", 1, self._calc_acknowledge, {ticket})

    def receive(
        self,
        root_context: Context,
        joints: JointSample,
        pose: PoseSample,
        people: PersonSample = _NOBODY,
    ) -> None:
        """Makes these the newest samples."""
        context = self.GetMyMutableContextFromRoot(root_context)
        context.get_mutable_abstract_parameter(self._received).set_value((joints, pose, people))

    def acknowledge(self, root_context: Context, is_acknowledged: bool) -> None:
        """Whether somebody lets the robot go on now; only where somebody looks for people."""
        context = self.GetMyMutableContextFromRoot(root_context)
        context.get_mutable_numeric_parameter(self._acknowledged).set_value([float(is_acknowledged)])

    def _calc_acknowledge(self, context: Context, output: BasicVector) -> None:
        output.set_value(context.get_numeric_parameter(self._acknowledged).value())

    def command(self, root_context: Context) -> tuple[np.ndarray, np.ndarray]:
        """The position (6,) in rad and velocity (6,) in rad/s that the servo commands now."""
        context = self.GetMyContextFromRoot(root_context)
        position, velocity = (port.Eval(context) for port in self._commands)
        return position, velocity

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
    and, where what the controller can do is obeyed:
        out ``speed_share``       vector 1: the share of the planned speed that it can do

    It touches no socket. Whoever holds the wire puts in what was received with `receive` and takes out what
    is to be sent with `command`.
    """

    def __init__(self, has_people: bool = False, has_share: bool = False) -> None:
        """Makes the station.

        Args:
            has_people: whether somebody looks for people.
            has_share: whether the controller's performance is obeyed.
        """
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
            self._acknowledged = self._declare_told("acknowledge", 0.0)
        if has_share:
            self._share = self._declare_told("speed_share", 1.0)

    def _declare_told(self, name: str, begin: float) -> NumericParameterIndex:
        """An output port with one number that is told from outside."""
        index = NumericParameterIndex(self.DeclareNumericParameter(BasicVector([begin])))

        def calc(context: Context, output: BasicVector) -> None:
            output.set_value(context.get_numeric_parameter(index).value())

        self.DeclareVectorOutputPort(name, 1, calc, {self.numeric_parameter_ticket(index)})
        return index

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

    def slow(self, root_context: Context, share: float) -> None:
        """The share of the planned speed that the controller can do; only where that is obeyed."""
        context = self.GetMyMutableContextFromRoot(root_context)
        context.get_mutable_numeric_parameter(self._share).set_value([share])

    def command(self, root_context: Context) -> tuple[np.ndarray, np.ndarray]:
        """The position (6,) in rad and velocity (6,) in rad/s that the servo commands now."""
        context = self.GetMyContextFromRoot(root_context)
        position, velocity = (port.Eval(context) for port in self._commands)
        return position, velocity

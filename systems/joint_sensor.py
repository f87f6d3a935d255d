"""The robot controller's report of its joints."""

from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem

from robots.model import NUM_JOINTS
from systems.samples import JointSample


class JointSensor(LeafSystem):
    """Stamps motor positions, velocities and torques.

    Ports:
        in  ``motor_state``   vector 12, positions in rad, then velocities in rad/s
        in  ``motor_torque``  vector 6, N m on the joint side
        out ``joint_sample``  JointSample at the time of evaluation
    """

    def __init__(self) -> None:
        super().__init__()
        self._state = self.DeclareVectorInputPort("motor_state", 2 * NUM_JOINTS)
        self._torque = self.DeclareVectorInputPort("motor_torque", NUM_JOINTS)
        self.DeclareAbstractOutputPort(
            "joint_sample",
            lambda: Value(JointSample()),
            self._calc,
            {self.time_ticket(), self._state.ticket(), self._torque.ticket()},
        )

    def _calc(self, context: Context, output) -> None:
        state = self._state.Eval(context)
        torque = self._torque.Eval(context)
        output.set_value(
            JointSample(context.get_time(), state[:NUM_JOINTS], state[NUM_JOINTS:], torque, True)
        )

"""The robot controller's report of its joints."""

import math

from pydrake.common.value import Value
from pydrake.systems.framework import Context

from robots.description.model import NUM_JOINTS
from systems.sampled_system import SampledSystem
from systems.samples import JointSample


class JointSensor(SampledSystem):
    """Stamps motor positions, velocities and torques.

    Ports:
        in  ``motor_state``   vector 12, positions in rad, then velocities in rad/s
        in  ``motor_torque``  vector 6, N m on the joint side
        out ``joint_sample``  JointSample at the time of evaluation

    A plant that runs away would be integrated in ever smaller steps without end, so the sensor breaks off.
    """

    def __init__(self, fastest: float = math.inf) -> None:
        """Declares the ports.

        Args:
            fastest: joint speed in rad/s that no working robot reaches; beyond it evaluation raises a
                RuntimeError, which ends the simulation.
        """
        super().__init__()
        self._fastest = fastest
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
        velocity = state[NUM_JOINTS:]
        if math.hypot(*velocity.tolist()) > self._fastest:
            raise RuntimeError(
                f"the simulated robot has run away: a joint is faster than {self._fastest:.0f} rad/s at "
                f"t = {context.get_time():.3f} s; check the gains and delays"
            )
        output.set_value(JointSample(context.get_time(), state[:NUM_JOINTS], velocity, torque, True))

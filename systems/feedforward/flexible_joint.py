"""The exact inverse of elastic joints: how far to wind up each gear so that the link is on its path."""

import numpy as np

from systems.feedforward.feedforward import Drive, Feedforward, JointReference


class FlexibleJointFeedforward(Feedforward):
    """Deflections from the load of the links, then torques of motors that turn ahead by them.

    The load tau bends spring and damper of a joint by K delta + D d(delta)/dt = -tau, Reiner (2010) eqs.
    (3.78), (3.93) for linear springs. The pole at -K/D, hundreds of 1/s here and thousands in the source, is
    integrated exactly for a load that changes linearly in a tick, so that the inverse is stable and bounded
    at any tick. The motors move by theta = q - delta and carry J theta'' + friction + tau.

    The memory holds deflections, their rates and the load of the last tick.
    """

    memory_size = 18

    def _drive(self, reference: JointReference, load: np.ndarray, memory: np.ndarray) -> Drive:
        K, D, T = self._stiffness, self._damping, self._period
        if np.isnan(memory[0]):
            deflection, rate, acceleration = -load / K, np.zeros_like(load), np.zeros_like(load)
        else:
            before, last_rate, last_load = memory[:6], memory[6:12], memory[12:]
            # x' = -(K x + tau) / D with tau linear: the particular solution is linear, the rest decays.
            slope = (load - last_load) / T
            decay = np.exp(-K * T / D)
            steady = -load / K + D * slope / K**2
            deflection = steady + decay * (before - (steady + slope * T / K))
            rate = -(K * deflection + load) / D
            acceleration = (rate - last_rate) / T
        velocity = reference.velocity - rate
        torque = self._motor_torque(velocity, reference.acceleration - acceleration, load)
        return Drive(deflection, rate, torque, np.concatenate([deflection, rate, load]))

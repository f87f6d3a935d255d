"""The exact inverse of elastic joints: how far to wind up each gear so that the link is on its path."""

import numpy as np

from robots.description.model import NUM_JOINTS
from systems.controller_model import ControllerModel
from systems.feedforward.backward_differences import HISTORY, BackwardDifferences, at_rest, with_newest
from systems.feedforward.config import FeedforwardConfig
from systems.feedforward.feedforward import Feedforward
from systems.feedforward.gear_parts import GearParts
from systems.feedforward.joint_motion import Drive, JointReference
from systems.feedforward.sprung_deflection import SprungDeflection


class FlexibleJointFeedforward(Feedforward):
    """Deflections from the load of the links, then torques of motors that turn ahead by them.

    The load tau bends spring and damper of a joint by c(delta) + D d(delta)/dt = -tau, Reiner (2010) eqs.
    (3.78), (3.93), with the linear or stiffening c of the robot's gears: a relative degree of three, so the
    motors' acceleration depends on the third derivative of the reference. They move by theta = q - delta and
    carry J theta'' + friction + tau.

    Where the robot's drive trains have further parts, their play, hysteresis, uneven ratio and losses are
    inverted, and a motor that lags gets what its torque will change by ahead of time.

    The memory holds the load of the last sub-step and the deflections of the last three; with further parts
    also the torque of the last one and what `GearParts` remembers.
    """

    title = "flexible joint"
    colour = "#e0a030"
    memory_size = (1 + HISTORY) * NUM_JOINTS
    derivatives = 3

    def __init__(
        self,
        model: ControllerModel,
        config: FeedforwardConfig,
        extra_memory: int = 0,
    ) -> None:
        """Builds the model; arguments and errors as of `Feedforward`."""
        trains = model.robot.drive_trains
        of_parts = NUM_JOINTS * 3 + trains.num_elements if trains else 0
        self.memory_size = type(self).memory_size + of_parts
        super().__init__(model, config, extra_memory)
        springs = model.robot.stiffening_gears
        if springs is not None:
            springs = springs.scaled(1.0 + config.stiffness_error)
        self._gears = SprungDeflection(self._stiffness, self._damping, self.substep, springs)
        self._gear_parts = GearParts(trains, self._gears) if trains else None
        self._differences = BackwardDifferences(self.substep)

    def drive_under(self, reference: JointReference, load: np.ndarray, memory: np.ndarray) -> Drive:
        """Motors that turn ahead by what the load deflects."""
        if self._gear_parts is not None:
            return self._drive_with_parts(self._gear_parts, reference, load, memory)
        if np.isnan(memory[0]):
            deflection = self._gears.at_rest(load)
            history = at_rest(deflection)
        else:
            history = memory[NUM_JOINTS:].reshape(HISTORY, NUM_JOINTS)
            deflection = self._gears.step(history[0], memory[:NUM_JOINTS], load)
        rate, acceleration = self._differences.derivatives(deflection, history)
        velocity = reference.velocity - rate
        torque = self.motor_torque(velocity, reference.acceleration - acceleration, load)
        history = with_newest(deflection, history)
        return Drive(deflection, rate, torque, np.concatenate([load, history.ravel()]))

    def _drive_with_parts(
        self, parts: GearParts, reference: JointReference, load: np.ndarray, memory: np.ndarray
    ) -> Drive:
        base, own = memory[: type(self).memory_size], memory[type(self).memory_size :]
        last_torque, of_parts = own[:NUM_JOINTS], own[NUM_JOINTS:]
        is_first = np.isnan(base[0])
        if is_first:
            deflection, of_parts = parts.at_rest(load, reference.position)
            history = at_rest(deflection)
        else:
            history = base[NUM_JOINTS:].reshape(HISTORY, NUM_JOINTS)
            deflection, of_parts = parts.step(of_parts, base[:NUM_JOINTS], load, reference.position)
        rate, acceleration = self._differences.derivatives(deflection, history)
        torque = self.motor_torque(reference.velocity - rate, reference.acceleration - acceleration, load)
        told = torque
        if not is_first and self._trains is not None:
            told = torque + self._trains.motor_lag / self.substep * (torque - last_torque)
        history = with_newest(deflection, history)
        return Drive(deflection, rate, told, np.concatenate([load, history.ravel(), torque, of_parts]))

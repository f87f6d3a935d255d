"""What gears add to the angle of a joint beyond their springs, as linear columns: waves, gap, hysteresis."""

from types import SimpleNamespace

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.drivetrain.dahl import DahlHysteresis
from systems.estimation.memory import Layout

# Of each joint: two waves with sine and cosine each, the gap, two hystereses.
SHAPE_NAMES = "sine_1", "cosine_1", "sine_2", "cosine_2", "gap", "hysteresis_1", "hysteresis_2"
NUM_SHAPES = len(SHAPE_NAMES)
_GAP_TORQUE = 0.5  # N m, beyond which the teeth are through the gap
_WIDTHS = 1e-4, 5e-4  # rad of deflection, after which hysteresis has turned over


class GearErrors:
    """Shapes of which a gear's error is a sum, each between -1 and 1.

    Sine and cosine of one and of two turns of the motor for the uneven ratio; tanh of the load for the gap,
    in which teeth lie against one side or the other; and two states of Dahl's model, driven by how far the
    gear's spring yields, for hysteresis.
    """

    def __init__(self, robot: RobotModel) -> None:
        """Reads gear ratios and springs."""
        self._ratio = np.asarray(robot.gear_ratio, dtype=float)
        self._compliance = 1.0 / np.asarray(robot.joint_stiffness, dtype=float)
        self._dahl = DahlHysteresis(np.zeros(2), np.array(_WIDTHS))
        self.layout = Layout(started=(1,), deflection=(NUM_JOINTS,), z=(NUM_JOINTS, 2))

    def step(self, memory: SimpleNamespace, torque: np.ndarray) -> np.ndarray:
        """Loads the gears by torques in N m, (6,); returns the states of hysteresis in -1 to 1, (12,)."""
        deflection = -self._compliance * torque
        turn = deflection - memory.deflection if memory.started[0] else np.zeros(NUM_JOINTS)
        memory.z[:] = self._dahl.moved(memory.z, turn)
        memory.deflection[:], memory.started[0] = deflection, 1.0
        return (memory.z / _WIDTHS).T.ravel()

    def shapes(self, theta: np.ndarray, torque: np.ndarray, states: np.ndarray) -> np.ndarray:
        """The shapes at motor positions in rad (6,), under torques in N m (6,), shape (7, 6).

        Args:
            theta: motor positions on the link side of the gear.
            torque: of the gears, as inverse dynamics has them.
            states: as `step` gave them.
        """
        turn = self._ratio * theta
        out = np.empty((NUM_SHAPES, NUM_JOINTS))
        out[0], out[1] = np.sin(turn), np.cos(turn)
        out[2], out[3] = 2.0 * out[0] * out[1], out[1] ** 2 - out[0] ** 2
        out[4] = -np.tanh(torque / _GAP_TORQUE)
        out[5:] = states.reshape(2, NUM_JOINTS)
        return out

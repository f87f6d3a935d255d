"""What gears add to the angle of a joint beyond their springs, as linear columns: waves, gap, hysteresis."""

from types import SimpleNamespace

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.drivetrain.dahl import DahlHysteresis
from systems.estimation.memory import Layout

# Of each joint: two waves with sine and cosine each, the gap, two hystereses.
SHAPE_NAMES = "sine_1", "cosine_1", "sine_2", "cosine_2", "gap", "hysteresis_1", "hysteresis_2"
NUM_SHAPES = len(SHAPE_NAMES)
# N m s from the middle of a gap to a side: grease of 20 N m s/rad in a gap of 0.2 mrad, assumed. Where the
# robot's is a quarter or four times as much, the tip is as near to its path to a hundredth of a millimetre.
_GAP_IMPULSE = 2e-3
NUM_STATES = 3 * NUM_JOINTS  # two of hysteresis of each joint, then where its teeth are
_WIDTHS = 1e-4, 5e-4  # rad of deflection, after which hysteresis has turned over


class GearErrors:
    """Shapes of which a gear's error is a sum, each between -1 and 1.

    Sine and cosine of one and of two turns of the motor for the uneven ratio; where the teeth are in their
    gap, which a load pushes them through against the grease until they lie against a side, and where they
    stay without one; and two states of Dahl's model, driven by how far the gear's spring yields, for
    hysteresis.
    """

    def __init__(self, robot: RobotModel) -> None:
        """Reads gear ratios and springs."""
        self._ratio = np.asarray(robot.gear_ratio, dtype=float)
        self._compliance = 1.0 / np.asarray(robot.joint_stiffness, dtype=float)
        self._dahl = DahlHysteresis(np.zeros(2), np.array(_WIDTHS))
        self.layout = Layout(started=(1,), deflection=(NUM_JOINTS,), z=(NUM_JOINTS, 2), teeth=(NUM_JOINTS,))

    def step(self, memory: SimpleNamespace, torque: np.ndarray, duration: float) -> np.ndarray:
        """Loads the gears by torques in N m, (6,), for a time in s; returns their states in -1 to 1, (18,).

        At first the teeth lie where the load has them.
        """
        teeth = memory.teeth - duration / _GAP_IMPULSE * torque
        memory.teeth[:] = np.clip(teeth, -1.0, 1.0) if memory.started[0] else -np.sign(torque)
        deflection = -self._compliance * torque
        turn = deflection - memory.deflection if memory.started[0] else np.zeros(NUM_JOINTS)
        memory.z[:] = self._dahl.moved(memory.z, turn)
        memory.deflection[:], memory.started[0] = deflection, 1.0
        return np.concatenate(((memory.z / _WIDTHS).T.ravel(), memory.teeth))

    def shapes(self, theta: np.ndarray, states: np.ndarray) -> np.ndarray:
        """The shapes at motor positions in rad (6,), shape (7, 6).

        Args:
            theta: motor positions on the link side of the gear.
            states: as `step` gave them.
        """
        turn = self._ratio * theta
        out = np.empty((NUM_SHAPES, NUM_JOINTS))
        out[0], out[1] = np.sin(turn), np.cos(turn)
        out[2], out[3] = 2.0 * out[0] * out[1], out[1] ** 2 - out[0] ** 2
        out[4] = states[2 * NUM_JOINTS :]
        out[5:] = states[: 2 * NUM_JOINTS].reshape(2, NUM_JOINTS)
        return out

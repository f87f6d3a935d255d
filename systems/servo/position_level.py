"""The error system on position level: the wanted pose, shifted by the integral of its error."""

import math
from dataclasses import dataclass

import numpy as np

from robots.configuration.quantity import choice
from robots.description.model import NUM_JOINTS
from robots.kinematics.forward import rotation_about
from robots.pose import error_of_rows, rotation_vector
from systems.controller_model import ControllerModel
from systems.guard.guard import GuardConfig
from systems.reference.paths import CartesianPath
from systems.servo.euler_correction import EulerCorrection
from systems.servo.law import LawInput, LawOutput, ServoLaw
from systems.servo.law_config import LawConfig

_TURN, _SHIFT, _JOINTS = slice(0, 3), slice(3, 6), slice(6, 24)


class RotationVectorCorrection:
    """The correction C of the orientation as a rotation, R_WC = R_WD C, without a singular orientation.

    With e the rotation vector of R_WE^T R_WD, in the axes of the tool, C goes on to C exp(K e~ dt). Where a
    constant turn D of the tool is all that is wrong, R_WE = R_WC D, each step shrinks e by K dt of itself,
    however large it is. C is kept as its rotation vector in rad.
    """

    def initial(self, X_WE: np.ndarray, X_WD: np.ndarray) -> np.ndarray:
        """The correction with which the command is X_WE, shape (3,)."""
        return -_error_in_tool(X_WD, X_WE)

    def check_path(self, path: CartesianPath) -> None:
        """Any path will do."""

    def rate(self, X_WD: np.ndarray, X_WE: np.ndarray) -> np.ndarray:
        """e in rad, shape (3,)."""
        return _error_in_tool(X_WD, X_WE)

    def moved(self, turn: np.ndarray, step: np.ndarray) -> np.ndarray:
        """The correction after a small turn (rad) on top of it."""
        return rotation_vector(_exp(turn) @ _exp(step))

    def command(
        self, turn: np.ndarray, rate: np.ndarray, R_WD: np.ndarray, w_WD: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Orientation and angular velocity to command, and the correction as a rotation vector in the world.

        Args:
            turn: the correction.
            rate: K e in rad/s.
            R_WD, w_WD: wanted orientation and angular velocity in rad/s.
        """
        R_WC = R_WD @ _exp(turn)
        return R_WC, w_WD + R_WC @ rate, R_WD @ turn


@dataclass
class PositionLevelConfig(LawConfig):
    """Its gains, and how it corrects the orientation."""

    # The form of the correction; euler, as the source has it
    angles: str = choice("rotation_vector", ("rotation_vector", "euler"))


class PositionLevel(ServoLaw):
    """Commands q(z_d + c) with dc/dt = K (z_d - z_m), Probst (2024) eqs. (5.18), (5.19).

    Corrected: c starts at minus the initial error, so that the first command is where the robot stands
    (the source adds the error and jumps by twice of it), and c turns the tool by a rotation and integrates
    rotation vectors, where the source has Euler angles. With ``angles: euler`` it has them too, differences
    wrapped, and refuses paths near their singular orientation.
    The initial error is taken from the nominal kinematics, because that is what makes the start smooth
    also for a robot whose geometry is wrong. The correction is limited.

    The memory holds c (orientation in rad, then the position in m) and the joints of the last tick.
    """

    title = "Position level"
    colour = "#009e73"
    Config = PositionLevelConfig
    awaits_joints = False
    is_compared = True
    memory_size = 24

    def __init__(self, model: ControllerModel, config: PositionLevelConfig, guard: GuardConfig) -> None:
        """Checks the configuration.

        Raises:
            ValueError: as `ServoLaw`; also if ``angles`` is unknown.
        """
        super().__init__(model, config, guard)
        if config.angles not in _CORRECTIONS:
            raise ValueError(
                f"position_level: angles must be one of {', '.join(_CORRECTIONS)}, got '{config.angles}'"
            )
        self._orientation = _CORRECTIONS[config.angles]()

    def check_path(self, path: CartesianPath) -> None:
        """Refuses a path whose orientations the form of the correction has not. Raises ValueError."""
        self._orientation.check_path(path)

    def initial_state(self, moment: LawInput) -> np.ndarray:
        """c at minus the initial error, the joints where they are measured."""
        rows, _ = self.kinematics.rows_and_jacobian(moment.position)
        shift = rows[:, 3] - moment.X_WD[:, 3]
        turn = self._orientation.initial(rows, moment.X_WD)
        return np.concatenate([turn, shift, moment.position, np.zeros(2 * NUM_JOINTS)])

    def step(self, moment: LawInput, memory: np.ndarray) -> LawOutput:
        """Integrates the correction and commands the joints for the corrected pose."""
        if isinstance(self._orientation, EulerCorrection):
            return self._step_as_written(moment, memory)
        X_WC, V_WC, kept, correction = np.empty((3, 4)), np.empty(6), np.empty(6), np.empty(6)
        self.kernels.corrected_pose(
            moment.X_WD,
            moment.V_WD,
            *(moment.measured or (moment.X_WD, moment.X_WD)),
            moment.measured is not None,
            memory,
            (self.config.rotation, self.config.translation),
            (self.angle_limit, self.config.correction_limit),
            self.period,
            X_WC,
            V_WC,
            kept,
            correction,
        )
        joints = self.joints_at(X_WC, V_WC, memory[_JOINTS])
        return LawOutput(joints[:6], joints[6:12], correction, np.concatenate([kept, joints]))

    def _step_as_written(self, moment: LawInput, memory: np.ndarray) -> LawOutput:
        """The same with any form of the correction, as its class says it."""
        turn, shift = memory[_TURN], memory[_SHIFT]
        turning = moving = np.zeros(3)
        if moment.measured is not None:
            wanted, seen = moment.measured
            turning = self.config.rotation * self._orientation.rate(wanted, seen)
            moving = self.config.translation * (wanted[:, 3] - seen[:, 3])
            turn = self._orientation.moved(turn, self.period * turning)
            shift = shift + self.period * moving
        turn = _limited(turn, self.angle_limit)
        shift = _limited(shift, self.config.correction_limit)
        X_WD, V_WD = moment.X_WD, moment.V_WD
        R_WC, w_WC, correction = self._orientation.command(turn, turning, X_WD[:, :3], V_WD[:3])
        X_WC = np.empty((3, 4))
        X_WC[:, :3], X_WC[:, 3] = R_WC, X_WD[:, 3] + shift
        joints = self.joints_at(X_WC, np.concatenate([w_WC, V_WD[3:] + moving]), memory[_JOINTS])
        return LawOutput(
            joints[:6],
            joints[6:12],
            np.concatenate([correction, shift]),
            np.concatenate([turn, shift, joints]),
        )


_CORRECTIONS = {"rotation_vector": RotationVectorCorrection, "euler": EulerCorrection}


def _error_in_tool(X_WD: np.ndarray, X_WE: np.ndarray) -> np.ndarray:
    """The rotation vector of R_WE^T R_WD, (3,) in rad: the error's in the axes of the tool."""
    return np.array(error_of_rows(X_WD.tolist(), X_WE.tolist())[:3]) @ X_WE[:, :3]


def _exp(turn: np.ndarray) -> np.ndarray:
    """The rotation matrix of a rotation vector in rad."""
    angle = math.sqrt(float(turn @ turn))
    return rotation_about(turn / (angle or 1.0), angle)


def _limited(correction: np.ndarray, limit: float) -> np.ndarray:
    """A correction, cut to its limit in angle or length."""
    size = math.sqrt(float(correction @ correction))
    return correction if size <= limit else limit / size * correction

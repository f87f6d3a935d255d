"""Encoders that are not perfect: discs off their centres, wrong scales, coupled wrists, whole steps."""

import math
from dataclasses import dataclass, field

import numpy as np
from pydrake.symbolic import Expression, MakeVectorContinuousVariable, cos, sin
from pydrake.systems.framework import BasicVector, Context, DiscreteValues
from pydrake.systems.primitives import SymbolicVectorSystem

from robots.configuration.quantity import choice, quantity, vector
from robots.description.model import NUM_JOINTS, RobotModel
from systems.sampled_system import SampledSystem

SIDES = ("joint", "motor")
_MOST_BITS = 32
_COUPLED = ((3, 4), (3, 5), (4, 5))  # of the wrist: the first turns the second along
_ROUNDS = 30  # of a search that gains a decimal or more in each


@dataclass
class EncoderConfig:
    """How well the angles of the motors are known; read from a scenario file."""

    side: str = choice("joint", SIDES)  # of the gear on which the discs sit
    # A turn of a disc has 2**bits steps; 0 for none, that is, exact angles
    bits: int = quantity(0, 0, _MOST_BITS)
    # Largest error of a disc's angle, once a turn of it
    eccentricity_deg: float = quantity(0.0, 0.0, 10.0, "deg")
    phase_deg: np.ndarray = field(default_factory=lambda: np.zeros(NUM_JOINTS))  # of that error at zero
    # By how much the joints turn more than their encoders tell, in millionths
    scale_ppm: np.ndarray = vector((0.0,) * NUM_JOINTS, -1e5, 1e5, "ppm")
    # By how much joint 4 turns joints 5 and 6 along, and joint 5 joint 6, unseen by encoders, in millionths
    coupling_ppm: np.ndarray = vector((0.0,) * len(_COUPLED), -1e5, 1e5, "ppm")


class Encoders:
    """What the discs of a robot say; angles are those of motors seen behind the gear, shape (..., 6)."""

    def __init__(self, robot: RobotModel, config: EncoderConfig) -> None:
        """Checks the configuration.

        Raises:
            ValueError: if the side is unknown or a number out of its range.
        """
        if config.side not in SIDES:
            raise ValueError(f"encoder: side must be one of {', '.join(SIDES)}, got '{config.side}'")
        if not 0 <= config.bits <= _MOST_BITS:
            raise ValueError(f"encoder: bits must be between 0 and {_MOST_BITS}, got {config.bits}")
        if not 0.0 <= config.eccentricity_deg <= 10.0:
            raise ValueError(
                f"encoder: eccentricity_deg must be between 0 and 10 deg, got {config.eccentricity_deg}"
            )
        self.turns = np.abs(robot.gear_ratio) if config.side == "motor" else np.ones(NUM_JOINTS)
        self.has_steps = config.bits > 0  # whether angles come in whole ones
        self.step = 2.0 * np.pi / 2**config.bits / self.turns if config.bits else np.zeros(NUM_JOINTS)
        self.amplitude = np.deg2rad(config.eccentricity_deg) / self.turns
        self.phase = np.deg2rad(np.asarray(config.phase_deg, dtype=float))
        self._true = np.diag(1.0 + 1e-6 * np.asarray(config.scale_ppm, dtype=float))
        for (source, joint), ppm in zip(_COUPLED, config.coupling_ppm, strict=True):
            self._true[joint, source] = 1e-6 * ppm
        self.linear = np.linalg.inv(self._true)  # what discs say of true positions but for the waves

    @property
    def have_errors(self) -> bool:
        """Whether they are wrong by more than their steps."""
        return bool(self.amplitude.any() or (self._true != np.eye(NUM_JOINTS)).any())

    def angle(self, theta: np.ndarray) -> np.ndarray:
        """What discs of infinitely many steps say of true motor positions in rad, (..., 6)."""
        return theta @ self.linear.T + self.amplitude * np.sin(self.turns * theta + self.phase)

    def true_position(self, angle: np.ndarray) -> np.ndarray:
        """True motor positions in rad at which the discs say these angles, the reverse of `angle`."""
        theta = np.asarray(angle, dtype=float) @ self._true.T
        for _ in range(_ROUNDS if self.amplitude.any() else 0):
            waves = self.amplitude * np.sin(self.turns * theta + self.phase)
            theta = (angle - waves) @ self._true.T
        return theta

    def rounded(self, angle: np.ndarray) -> np.ndarray:
        """Angles in rad to whole steps."""
        if not self.has_steps:
            return angle
        return self.step * np.rint(angle / self.step)


def erring_encoders(encoders: Encoders) -> SymbolicVectorSystem:
    """From the true motor state to the one that the discs say, 12 numbers each.

    The drives control what the discs say, so that the motors are wrong by the errors of the encoders. A
    system of Drake's own, for it is asked at every stage of every step of the integrator.
    """
    state = MakeVectorContinuousVariable(2 * NUM_JOINTS, "x")
    outputs = []
    for order in range(2):
        own = [Expression(each) for each in state[order * NUM_JOINTS : (order + 1) * NUM_JOINTS]]
        for i in range(NUM_JOINTS):
            turn = float(encoders.turns[i]) * Expression(state[i]) + float(encoders.phase[i])
            amplitude = float(encoders.amplitude[i])
            said = sum((float(encoders.linear[i, j]) * own[j] for j in range(NUM_JOINTS)), Expression(0.0))
            if order == 0:
                outputs.append(said + amplitude * sin(turn))
            else:
                outputs.append(said + amplitude * float(encoders.turns[i]) * cos(turn) * own[i])
    # Without a state of its own such a system refuses to be integrated along with others: one that rests.
    idle = MakeVectorContinuousVariable(1, "idle")
    at_rest = np.array([Expression(0.0)], dtype=object)
    return SymbolicVectorSystem(
        input=state, state=idle, dynamics=at_rest, output=np.array(outputs, dtype=object)
    )


class SteppedReading(SampledSystem):
    """Angles in whole steps, and velocities that are differences of two of them a period apart.

    Ports:
        in  ``motor_state``  vector 12, positions in rad, then velocities in rad/s
        out ``motor_state``  vector 12, as it is reported

    Drives read their encoders far more often than the controller does; their own loops stay exact.
    """

    def __init__(self, encoders: Encoders, period: float) -> None:
        """Declares the ports.

        Args:
            encoders: with steps.
            period: between two readings that are reported, in s.
        """
        super().__init__()
        self._encoders, self._period = encoders, period
        self._state = self.DeclareVectorInputPort("motor_state", 2 * NUM_JOINTS)
        self._before = self.DeclareDiscreteState(np.full(NUM_JOINTS, np.nan))
        self.DeclareVectorOutputPort(
            "motor_state", 2 * NUM_JOINTS, self._calc, {self._state.ticket(), self.xd_ticket()}
        )
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._remember)

    def _reading(self, context: Context) -> np.ndarray:
        return self._encoders.rounded(self._state.Eval(context)[:NUM_JOINTS])

    def _remember(self, context: Context, discrete_state: DiscreteValues) -> None:
        discrete_state.set_value(self._before, self._reading(context))

    def _calc(self, context: Context, output: BasicVector) -> None:
        now = self._reading(context)
        reported = output.get_mutable_value()
        reported[:NUM_JOINTS] = now
        rate = (now - context.get_discrete_state(self._before).value()) / self._period
        reported[NUM_JOINTS:] = rate if math.isfinite(sum(rate.tolist())) else 0.0

"""The two-joint arm about rest as transfer functions: an observer around its inverse, and a virtual output.

The driven joint follows its command; the output is the transverse position of a point x_l beyond the centre
of mass, where the exact inverse is unstable. Reiner (2010), sections 3.5.2, 3.5.3 and 5.2.1.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import Polynomial
from scipy import signal

from experiments.feedforward.two_joint_arm import DAMPING, FAR, LENGTH, STIFFNESS, TwoJointArm
from robots.dynamics.transmission_zeros import Zeros, transmission_zeros
from robots.dynamics.virtual_output import VirtualOutput, virtual_output
from systems.feedforward.inverse_observer import InverseObserver, bessel_denominator

STEP, START, DURATION, END = 2e-4, 0.05, 0.35, 1.2  # s
DISTANCE = 0.5  # m
_PREFILTER = 60.0  # Hz, five orders of Bessel, as the inverse differentiates
_RISE = Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])  # from 0 to 1, four derivatives continuous
TIMES = np.arange(0.0, END, STEP)


def wanted_path() -> np.ndarray:
    """The output that is asked for in m, at `TIMES`."""
    return DISTANCE * _RISE(np.clip((TIMES - START) / DURATION, 0.0, 1.0))


@dataclass(frozen=True)
class LinearArm:
    """The arm with its output x_l (m) beyond the centre of mass of the second bar."""

    x_l: float = 0.5
    stiffness: float = STIFFNESS  # N m / rad
    damping: float = DAMPING  # N m s / rad

    @cached_property
    def mass(self) -> np.ndarray:
        """(2, 2), kg m^2: of the driven joint and the sprung one."""
        plant = TwoJointArm().plant
        return plant.CalcMassMatrix(plant.CreateDefaultContext())

    @property
    def levers(self) -> np.ndarray:
        """Of the driven joint and of the sprung one, m."""
        return np.array([LENGTH + self.x_l, FAR + self.x_l])

    @property
    def zeros(self) -> Zeros:
        """From the driven joint to the output."""
        springs, dampers = np.diag([0.0, self.stiffness]), np.diag([0.0, self.damping])
        return transmission_zeros(self.mass, dampers, springs, np.array([[1.0], [0.0]]), self.levers[None])

    @property
    def plant(self) -> tuple[Polynomial, Polynomial]:
        """From the angle of the driven joint to the output; numerator and denominator in s."""
        spring = Polynomial([self.stiffness, self.damping, self.mass[1, 1]])
        coupling = Polynomial([0.0, 0.0, self.mass[0, 1]])
        return self.levers[0] * spring - self.levers[1] * coupling, spring

    @property
    def inverse(self) -> tuple[Polynomial, Polynomial]:
        """The approximate inverse: the spring under the load of a rigid arm (3.41), then the driven joint."""
        spring = Polynomial([self.stiffness, self.damping])
        coupling = Polynomial([0.0, 0.0, self.mass[0, 1]])
        first, second = self.levers
        return spring * first + second * coupling, first**2 * spring

    def state_space(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A, B, C; the input is the torque of the driven joint, the last state its rate, as (3.49) asks."""
        inverse = np.linalg.inv(self.mass)
        A, B = np.zeros((4, 4)), np.r_[0.0, 0.0, inverse[:, 0]]
        A[:2, 2:] = np.eye(2)
        A[2:, 1], A[2:, 3] = -inverse[:, 1] * self.stiffness, -inverse[:, 1] * self.damping
        order = [0, 1, 3, 2]
        return A[np.ix_(order, order)], B[order], np.r_[self.levers, 0.0, 0.0]


def observed_error(arm: LinearArm, observer: InverseObserver | None) -> np.ndarray | None:
    """Wanted less reached output in m, at `TIMES`; None if the loop is unstable."""
    (reach, reach_below), (command, command_below) = arm.plant, arm.inverse
    numerator, denominator = (
        reach * command,
        reach_below * command_below,
    )  # from what is asked for to the output
    if observer is None:
        return _response(denominator - numerator, denominator)
    gain, gain_below = observer.gain()
    closed = denominator * gain_below + gain * numerator
    if np.real(closed.roots()).max() > 1e-6:
        return None
    return _response((denominator - numerator) * gain_below, closed)


def virtual_outputs(arm: LinearArm, wanted: np.ndarray) -> tuple[VirtualOutput, np.ndarray, np.ndarray]:
    """The virtual output with these zeros, and what the arm does that is inverted with respect to it.

    Args:
        arm: that is inverted.
        wanted: three zeros in 1/s.

    Returns:
        The virtual output; that of the arm in m at `TIMES` if the virtual one shall follow the path, and
        if it shall follow what it is along the approximate inverse, (3.50).
    """
    A, B, C = arm.state_space()
    found = virtual_output(A, B, C, wanted)
    own = Polynomial(signal.ss2tf(A, B[:, None], C[None], np.zeros((1, 1)))[0][0][::-1][:4])
    alone = _response(own, found.numerator)
    # The state along the approximate inverse: driven joint, sprung joint, their rates.
    command, below = arm.inverse
    s = Polynomial([0.0, 1.0])
    sprung = -arm.levers[0] * arm.mass[0, 1] * s**2
    along = [command, sprung, sprung * s, command * s]
    of_virtual = sum(
        (weight * each for weight, each in zip(found.row, along, strict=True)), Polynomial([0.0])
    )
    return found, alone, _response(own * of_virtual, found.numerator * below)


def _response(numerator: Polynomial, denominator: Polynomial) -> np.ndarray:
    """To the path behind a prefilter less what the filter is late, so that only the system is seen."""
    below = (denominator * bessel_denominator(5, _PREFILTER)).coef[::-1]
    above = np.trim_zeros(numerator.coef[::-1], "f")
    return signal.lsim(signal.TransferFunction(above, below), wanted_path(), TIMES)[1]


def filtered_path() -> np.ndarray:
    """The path behind the prefilter, what the output shall be, in m at `TIMES`."""
    one = Polynomial([1.0])
    return _response(one, one)

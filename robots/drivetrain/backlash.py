"""Backlash of a gear, and a smooth substitute; rad, rad/s and N m on the side of the link."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from robots.drivetrain.monotone import monotone_inverse
from robots.drivetrain.stiffness import GearSpring

# rad beyond the gap, within which teeth take up their damping. With a jump the equations of an implicit
# integrator have no solution in a step that ends at contact, and it makes hundreds of steps in their place.
# The largest errors of six robots were up to 3 micrometres more or less for it, as with other noise.
CONTACT_DEPTH = 1e-7


def contact(beyond: np.ndarray, spring: np.ndarray, damper: np.ndarray) -> np.ndarray:
    """What teeth exert in N m: nothing in the gap, and beyond it nothing that pulls.

    Args:
        beyond: how far in rad the deflection is beyond the gap, zero within.
        spring: torque of the spring at that deflection in N m.
        damper: torque of the damper in N m, which acts in full once teeth have met by `CONTACT_DEPTH`.
    """
    torque = spring + damper * np.minimum(np.abs(beyond) / CONTACT_DEPTH, 1.0)
    return np.where(torque * beyond > 0.0, torque, 0.0)


@dataclass(frozen=True)
class Backlash:
    """A spring and damper that act only beyond half of the gap, Reiner (2010) eq. (2.12), corrected.

    The conditions are on phi_rel - phi_0 like the torques, not on phi_rel. The damping torque jumps at
    contact in (2.12); here it rises within `CONTACT_DEPTH`, which is no less a reason why the model cannot be
    inverted. Teeth that part do not pull: where the damping torque would outdo the spring, (2.12) is cut off
    at zero.
    """

    spring: GearSpring
    damping: float  # N m s / rad
    gap: float  # rad
    centre: float = 0.0  # rad, phi_0

    invertible: ClassVar[bool] = False

    def __post_init__(self) -> None:
        for label in ("damping", "gap"):
            if not getattr(self, label) >= 0.0:
                raise ValueError(f"Backlash: {label} must not be negative, got {getattr(self, label)}")

    def torque(self, deflection: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Torques in N m at deflections in rad and their rates in rad/s."""
        offset = np.asarray(deflection) - self.centre
        beyond = offset - np.clip(offset, -0.5 * self.gap, 0.5 * self.gap)
        return contact(beyond, self.spring.torque(beyond), self.damping * np.asarray(rate))


@dataclass(frozen=True)
class ViscoElasticGear:
    """A smooth substitute for a gap, Reiner (2010) figure 2.5(b): a stiffening spring and a soft lossy one.

    Beside the spring of the structure stands the soft spring c_2 in series with c_3 and a damper, which are
    parallel to each other. At small loads the soft ones carry and yield as a gap would, at large ones the
    structure; all equations are smooth and can be inverted. The text leaves the arrangement open; with all
    springs in a row the gear would stay soft under any load. The state x is the deflection of c_3:
    d x' + c_3 x = c_2 (phi - x), and the torque is tau_1(phi) + c_2 (phi - x).
    """

    structure: GearSpring  # tau_1, weak at rest and stiff under load
    soft: float  # c_2, N m / rad
    damped: float  # c_3, N m / rad
    damping: float  # d, N m s / rad, parallel to c_3

    invertible: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for label in ("soft", "damped", "damping"):
            if not getattr(self, label) > 0.0:
                raise ValueError(f"ViscoElasticGear: {label} must be positive, got {getattr(self, label)}")

    def torque(self, deflection: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Torques in N m at deflections and states in rad."""
        return self.structure.torque(np.asarray(deflection)) + self.soft * (np.asarray(deflection) - x)

    def rate(self, deflection: np.ndarray, x: np.ndarray) -> np.ndarray:
        """dx/dt in rad/s."""
        return (self.soft * (np.asarray(deflection) - x) - self.damped * np.asarray(x)) / self.damping

    def deflection(self, torque: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Deflections in rad that take torques in N m at states in rad: the inverse of `torque`."""
        load = np.asarray(torque, dtype=float) + self.soft * np.asarray(x)

        def function(deflection: np.ndarray) -> np.ndarray:
            return self.structure.torque(deflection) + self.soft * deflection

        def slope(deflection: np.ndarray) -> np.ndarray:
            return self.structure.stiffness(deflection) + self.soft

        return monotone_inverse(function, slope, load, np.maximum(np.abs(load), 1e-12) / self.soft)

    def energy(self, deflection: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Energy stored in the three springs in J."""
        stretch = np.asarray(deflection) - x
        springs = 0.5 * self.soft * stretch**2 + 0.5 * self.damped * np.square(x)
        return self.structure.energy(np.asarray(deflection)) + springs

"""How much of each limit a motion uses, and which one binds where."""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import trapezoid

from robots.description.model import NUM_JOINTS
from robots.planning.joint_path import PathError
from robots.planning.limits import JOINT_LIMITS, OVER_TIME, MotionLimits
from robots.planning.path_dynamics import ORDERS, Demand, PathDynamics

_PLACES = 101  # on a path
BINDING = 0.98  # share of a limit from which on it is said to bind


@dataclass(frozen=True)
class Use:
    """Shares of limits, 1 where one is reached.

    Attributes:
        names: of the limits, k.
        shares: over the motion, shape (k, n).
        mean_torque: root of the mean square of each motor's torque over what it may be, shape (6,).
    """

    names: list[str]
    shares: np.ndarray
    mean_torque: np.ndarray

    @property
    def largest(self) -> float:
        """The largest share of any limit at any time."""
        return float(max(self.shares.max(), self.mean_torque.max()))

    @property
    def by_limit(self) -> dict[str, float]:
        """The largest share of every limit, by its name."""
        found = dict(zip(self.names, map(float, self.shares.max(axis=1)), strict=True))
        for joint, share in enumerate(self.mean_torque, 1):
            if share > 0.0:
                found[f"{JOINT_LIMITS['continuous_torque'][1]} {joint}"] = float(share)
        return found

    @property
    def binding(self) -> list[str]:
        """The limits that are reached somewhere, the most used first."""
        ranked = sorted(self.by_limit.items(), key=lambda each: -each[1])
        return [name for name, share in ranked if share >= BINDING]


def use_of(demand: Demand, limits: MotionLimits, times: np.ndarray) -> Use:
    """What a motion uses of limits that are finite.

    Args:
        demand: at n times.
        limits: of the robot and the tool.
        times: s, shape (n,).
    """
    names, shares = [], []
    for name in OVER_TIME:
        values, most = np.abs(getattr(demand, name)), getattr(limits, name)
        for joint in np.flatnonzero(np.isfinite(most)):
            names.append(f"{JOINT_LIMITS[name][1]} {joint + 1}")
            shares.append(values[:, joint] / most[joint])
    for name in ("tool_speed", "tool_acceleration"):
        if np.isfinite(getattr(limits, name)):
            names.append(name.replace("_", " "))
            shares.append(getattr(demand, name) / getattr(limits, name))
    span = times[-1] - times[0]
    squares = trapezoid(demand.motor_torque**2, times, axis=0) / span if span else np.zeros(NUM_JOINTS)
    return Use(names, np.array(shares), np.sqrt(squares) / limits.continuous_torque)


def energy(demand: Demand, times: np.ndarray, recuperation: bool = False) -> float:
    """Work of all motors in J, Reiner (2010) eq. (5.5a); with recuperation braking gives it back."""
    return float(trapezoid(demand.net_power if recuperation else demand.power, times))


def require_standing(dynamics: PathDynamics, limits: MotionLimits) -> None:
    """Refuses a path on which the limits do not even let the arm stand still.

    Raises:
        PathError: with the limit and the place.
    """
    s = np.linspace(0.0, 1.0, _PLACES)
    rates = np.zeros((ORDERS, len(s)))
    rates[0] = s
    use = use_of(dynamics.demand(rates), limits, s)
    row, place = np.unravel_index(use.shares.argmax(), use.shares.shape)
    if use.shares[row, place] >= 1.0:
        raise PathError(
            f"the limits admit no motion: to stand still at {100.0 * s[place]:.0f} % of the path takes "
            f"{100.0 * use.shares[row, place]:.0f} % of the {use.names[row]}"
        )

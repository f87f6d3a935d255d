"""What gravity does to the joints of a robot, and how that depends on masses that are not quite known.

A joint yields by its compliance times the torque. The masses behind the torque are those of a robot file,
which nobody has weighed: they are parameters with a prior of their own, so that the standard deviations of
the compliances contain them.
"""

import numpy as np

from robots.calibration.error_model import Chain
from robots.description.model import NUM_JOINTS, RobotModel

GRAVITY = 9.81  # m/s^2, as Drake's

BODIES = (*(f"link_{number}" for number in range(1, NUM_JOINTS + 1)), "payload")
MASS_NAMES = tuple(f"mass_{body}" for body in BODIES)
CENTRE_NAMES = tuple(f"centre_{body}_{axis}" for body in BODIES for axis in "xyz")
NUM_MASSES = len(MASS_NAMES) + len(CENTRE_NAMES)  # 28
_ACTS = np.triu(np.ones((NUM_JOINTS, NUM_JOINTS)))  # joint i carries link j >= i


class Loads:
    """Torques of gravity and of a counterbalance about the joints, for rows with loads of their own."""

    def __init__(self, robot: RobotModel, payload: np.ndarray) -> None:
        """Takes the masses.

        Args:
            robot: with its masses and the centre of a payload.
            payload: mass at the flange in kg, shape (n,).

        Raises:
            ValueError: if the robot may not carry a payload.
        """
        largest = robot.payload.largest_mass
        if payload.min(initial=0.0) < 0.0 or payload.max(initial=0.0) > largest:
            worst = payload[np.argmax(np.abs(payload - 0.5 * largest))]
            raise ValueError(f"payload of {robot.name} must be between 0 and {largest} kg, got {worst:g} kg")
        self._mass = np.array([link.mass for link in robot.links])
        self._centre = np.array(
            [*(link.center_of_mass for link in robot.links), robot.payload.center_of_mass]
        )
        self._payload = payload
        self._counterbalance = robot.counterbalance_at_axis_2

    def torque(self, q: np.ndarray, chain: Chain, masses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Torques in N m, (n, 6), and their derivative by the masses, (n, 6, 28).

        Args:
            q: where the joints stand in rad, (n, 6).
            chain: where the links stand.
            masses: relative errors of the masses, then errors of the centres of mass in m, in the order of
                `MASS_NAMES` and `CENTRE_NAMES`, shape (28,).
        """
        n = len(self._payload)
        mass = np.column_stack([np.broadcast_to(self._mass, (n, NUM_JOINTS)), self._payload])
        mass = mass * (1.0 + masses[: len(BODIES)])
        centre = self._centre + masses[len(BODIES) :].reshape(-1, 3)
        carrier = [*range(NUM_JOINTS), NUM_JOINTS - 1]  # the payload hangs at the last link
        acts = _ACTS[:, carrier]  # (6, 7)
        R, origins = chain.R_WL[carrier], chain.p_WL[carrier]
        places = np.moveaxis(origins + np.einsum("bnij,bj->bni", R, centre), 1, 0)  # (n, 7, 3)
        a, o = np.moveaxis(chain.axes, 1, 0), np.moveaxis(chain.p_WL, 1, 0)  # (n, 6, 3)
        # a . (r x f) = r . (f x a) with the weight f = (0, 0, -g) of one kilogram
        turning = GRAVITY * np.stack([a[..., 1], -a[..., 0], np.zeros_like(a[..., 0])], -1)
        lever = np.einsum("nik,nbk->nib", turning, places) - np.sum(turning * o, -1)[..., None]
        by_mass = acts * mass[:, None, :] * lever
        torque = by_mass.sum(-1)
        if self._counterbalance is not None:
            torque[:, 1] += self._counterbalance.torque(q[:, 1])
        by_centre = (acts * mass[:, None, :])[..., None] * np.einsum("nik,bnkj->nibj", turning, R)
        share = 1.0 + masses[: len(BODIES)]
        return torque, np.concatenate([by_mass / share, by_centre.reshape(n, NUM_JOINTS, -1)], -1)

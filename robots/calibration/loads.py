"""What gravity does to the joints of a robot, and how that depends on masses that are not quite known.

A joint yields by its compliance times the torque. The masses behind the torque are those of a robot file,
which nobody has weighed: they are parameters with a prior of their own, so that the standard deviations of
the compliances contain them.
"""

import numpy as np

from robots.calibration.error_model import NUM_PLACED, PLACEMENTS, ZEROS, Chain
from robots.description.model import NUM_JOINTS, RobotModel

GRAVITY = 9.81  # m/s^2, as Drake's

BODIES = (*(f"link_{number}" for number in range(1, NUM_JOINTS + 1)), "payload")
MASS_NAMES = tuple(f"mass_{body}" for body in BODIES)
CENTRE_NAMES = tuple(f"centre_{body}_{axis}" for body in BODIES for axis in "xyz")
NUM_MASSES = len(MASS_NAMES) + len(CENTRE_NAMES)  # 28
_CARRIER = [*range(NUM_JOINTS), NUM_JOINTS - 1]  # the payload hangs at the last link
_ACTS = np.triu(np.ones((NUM_JOINTS, NUM_JOINTS)))[:, _CARRIER]  # (6, 7): joint i carries what is behind it


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
        mass, centre = self._bodies(masses)
        n, R = len(mass), chain.R_WL[_CARRIER]
        places, turning = _places(chain, centre), _turning(chain)
        lever = np.einsum("nik,nbk->nib", turning, places) - np.sum(turning * _origins(chain), -1)[..., None]
        by_mass = _ACTS * mass[:, None, :] * lever
        torque = by_mass.sum(-1)
        if self._counterbalance is not None:
            torque[:, 1] += self._counterbalance.torque(q[:, 1])
        by_centre = (_ACTS * mass[:, None, :])[..., None] * np.einsum("nik,bnkj->nibj", turning, R)
        share = 1.0 + masses[: len(BODIES)]
        return torque, np.concatenate([by_mass / share, by_centre.reshape(n, NUM_JOINTS, -1)], -1)

    def by_geometry(self, chain: Chain, Theta: np.ndarray, masses: np.ndarray) -> np.ndarray:
        """Derivative of the torques by the parameters of the error model, (n, 6, m).

        What poses alone cannot tell apart, such as a longer last link and a longer tool, loads can: the link
        carries the payload along. The counterbalance is left out, it stays with its two links.

        Args:
            chain: where the links stand.
            Theta: regressors of the error model there, shape (n, 6, m).
            masses: as for `torque`.
        """
        mass, centre = self._bodies(masses)
        n = len(mass)
        origins, axes, turning = _origins(chain), np.moveaxis(chain.axes, 1, 0), _turning(chain)
        carried = mass @ _ACTS.T  # (n, 6) kg behind each joint
        moments = np.einsum("ib,nb,nbk->nik", _ACTS, mass, _places(chain, centre))  # about the origin of W
        by_turn = np.zeros((n, NUM_JOINTS, len(PLACEMENTS), 3))  # by w of a placement
        by_shift = np.zeros_like(by_turn)  # by a shift of a placement, in the world
        weight = np.array([0.0, 0.0, -GRAVITY])
        own = moments - carried[..., None] * origins  # about the origin of each joint
        # Joints that turn along with what they carry see the weight turn the other way.
        along = -np.cross(weight, np.cross(axes, own))
        for k in range(NUM_JOINTS + 1):
            by_turn[:, max(k - 1, 0) :, k] = along[:, max(k - 1, 0) :]
            if k > 1:
                before = turning[:, : k - 1]
                by_shift[:, : k - 1, k] = carried[:, k - 1, None, None] * before
                by_turn[:, : k - 1, k] = np.cross(own[:, None, k - 1], before)
        placed = Theta[:, :, :NUM_PLACED].reshape(n, 6, len(PLACEMENTS), 6)
        columns = np.einsum("nibk,nkbc->nibc", by_turn, placed[:, :3])
        columns[..., :3] += np.einsum("nibk,nkbc->nibc", by_shift, placed[:, 3:, :, :3])
        found = np.zeros((n, NUM_JOINTS, Theta.shape[2]))
        found[..., :NUM_PLACED] = columns.reshape(n, NUM_JOINTS, -1)
        found[..., ZEROS] = np.einsum("nibk,nkb->nib", by_turn[:, :, 1:-1], Theta[:, :3, ZEROS])
        return found

    def _bodies(self, masses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Masses (n, 7) in kg and centres of mass (7, 3) in m with their errors."""
        n = len(self._payload)
        mass = np.column_stack([np.broadcast_to(self._mass, (n, NUM_JOINTS)), self._payload])
        centre = self._centre + masses[len(BODIES) :].reshape(-1, 3)
        return mass * (1.0 + masses[: len(BODIES)]), centre


def _origins(chain: Chain) -> np.ndarray:
    """Of the links in the world, (n, 6, 3)."""
    return np.moveaxis(chain.p_WL, 1, 0)


def _places(chain: Chain, centre: np.ndarray) -> np.ndarray:
    """Centres of mass in the world, (n, 7, 3)."""
    turned = np.einsum("bnij,bj->bni", chain.R_WL[_CARRIER], centre)
    return np.moveaxis(chain.p_WL[_CARRIER] + turned, 1, 0)


def _turning(chain: Chain) -> np.ndarray:
    """What one kilogram at r does to the joints, as r . turning: a . (r x f) = r . (f x a), (n, 6, 3)."""
    a = np.moveaxis(chain.axes, 1, 0)
    return GRAVITY * np.stack([a[..., 1], -a[..., 0], np.zeros_like(a[..., 0])], -1)

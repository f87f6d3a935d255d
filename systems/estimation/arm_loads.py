"""What gears and bearings carry: inverse dynamics of a stiff arm, linear in mass and place of its load."""

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.elastic_structure import tilting_axes
from systems.estimation.arm_geometry import skew

GRAVITY = 9.81  # m/s^2, as Drake has it
NUM_SETS = 5  # the arm itself, a kilogram of payload, and a kg m of its first moment along x, y, z
_SHARED = np.array([0, 1, 2, 3, 4, 5, 5])  # the link of each body; the payload moves with the last link


class ArmLoads:
    """Torques about joints and bearings of an arm whose frames are given, whatever its geometry.

    Newton and Euler's equations from the base to the flange and back, as sums over the links: for any number
    of configurations at once.
    """

    def __init__(self, robot: RobotModel) -> None:
        """Reads masses, centres and inertias of the links and of the payload."""
        links, payload = robot.links, robot.payload
        self._mass = np.array([link.mass for link in links] + [1.0])
        centres = [link.center_of_mass for link in links] + [payload.center_of_mass]
        self._centres = np.array(centres, dtype=float)
        share = 1.0 / payload.largest_mass if payload.largest_mass > 0.0 else 0.0
        inertia = [link.inertia_matrix for link in links] + [np.diag(share * np.asarray(payload.inertia))]
        self._inertia = np.array(inertia, dtype=float)
        axes = [
            [axis, *tilting_axes(joint.axis)] for axis, joint in zip(robot.axes, robot.joints, strict=True)
        ]
        self._axes = np.array(axes).swapaxes(1, 2)  # (6, 3, 3), columns
        self._counterbalance = robot.counterbalance_at_axis_2

    def at(
        self, frames: np.ndarray, q: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray
    ) -> np.ndarray:
        """Loads as inverse dynamics has them: what the inner part exerts on the outer one.

        Args:
            frames: of the world and the six links in the world, shape (n, 7, 4, 4).
            q, velocity, acceleration: of the joints behind the gears, shape (n, 6).

        Returns:
            Shape (n, 5, 18): for the arm itself, per kg of payload, and per kg m of first moment along the
            axes of the flange; the six gears, then two tilts of each bearing, in N m.
        """
        n = len(frames)
        R, origin = frames[:, 1:, :3, :3], frames[:, 1:, :3, 3]
        all_axes = R @ self._axes  # (n, 6, 3, 3)
        axis = all_axes[..., 0]
        spin = axis * velocity[..., None]
        w = np.cumsum(spin, axis=1)
        W = skew(w)
        turning = axis * acceleration[..., None] + (W @ spin[..., None])[..., 0]
        alpha = np.cumsum(turning, axis=1)
        A = skew(alpha) + W @ W  # the acceleration of a point of the link is A times its way from the origin
        ways = origin[:, 1:] - origin[:, :-1]
        a = np.zeros((n, NUM_JOINTS, 3))
        np.cumsum((A[:, :-1] @ ways[..., None])[..., 0], axis=1, out=a[:, 1:])
        a[..., 2] += GRAVITY
        R7, A7 = R[:, _SHARED], A[:, _SHARED]
        centre = (R7 @ self._centres[..., None])[..., 0]
        force = self._mass[:, None] * (a[:, _SHARED] + (A7 @ centre[..., None])[..., 0])
        # Euler's equation in the axes of the link, where the inertia is constant.
        spins = np.stack([w, alpha], -1)[:, _SHARED]
        spins = R7.swapaxes(-1, -2) @ spins
        momentum = self._inertia @ spins
        couple = momentum[..., 1:] + skew(spins[..., 0]) @ momentum[..., :1]
        couple = (R7 @ couple)[..., 0]
        arm = origin[:, _SHARED] + centre
        moment = couple + (skew(arm) @ force[..., None])[..., 0]
        F, M = np.empty((n, NUM_JOINTS, 3, NUM_SETS)), np.empty((n, NUM_JOINTS, 3, NUM_SETS))
        F[..., 0] = np.cumsum(force[:, 5::-1], axis=1)[:, ::-1]
        M[..., 0] = np.cumsum(moment[:, 5::-1], axis=1)[:, ::-1]
        F[..., 1], M[..., 1] = force[:, 6:], moment[:, 6:]
        # A mass m at c exerts m (a + A c), and its moment about the flange changes with c by c x m a.
        by_moment = A[:, 5] @ R[:, 5]
        F[..., 2:] = by_moment[:, None]
        M[..., 2:] = (skew(origin[:, 5]) @ by_moment - skew(a[:, 5]) @ R[:, 5])[:, None]
        about_joint = M - skew(origin) @ F
        torque = all_axes.swapaxes(-1, -2) @ about_joint  # (n, 6, 3 axes, sets)
        loads = np.empty((n, NUM_SETS, 18))
        loads[..., :6] = torque[:, :, 0].swapaxes(1, 2)
        loads[..., 6:] = torque[:, :, 1:].reshape(n, 12, NUM_SETS).swapaxes(1, 2)
        if self._counterbalance is not None:
            loads[:, 0, 1] -= self._counterbalance.torque(q[:, 1])
        return loads

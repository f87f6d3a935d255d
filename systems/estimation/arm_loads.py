"""What gears and bearings carry: inverse dynamics of a stiff arm, linear in mass and place of its load."""

import numpy as np

from robots.description.model import RobotModel
from robots.dynamics.elastic_structure import tilting_axes
from systems.estimation import kernels
from systems.estimation.kernels.arrays import Masses

NUM_SETS = 5  # the arm itself, a kilogram of payload, and a kg m of its first moment along x, y, z


class ArmLoads:
    """Torques about joints and bearings of an arm whose frames are given, whatever its geometry."""

    def __init__(self, robot: RobotModel) -> None:
        """Reads masses, centres and inertias of the links and of the payload."""
        links, payload = robot.links, robot.payload
        share = 1.0 / payload.largest_mass if payload.largest_mass > 0.0 else 0.0
        inertia = [link.inertia_matrix for link in links] + [np.diag(share * np.asarray(payload.inertia))]
        axes = [
            [axis, *tilting_axes(joint.axis)] for axis, joint in zip(robot.axes, robot.joints, strict=True)
        ]
        spring, part = np.zeros(7), robot.counterbalance_at_axis_2
        if part is not None:
            radii, dead_centre = (part.base_radius, part.arm_radius), float(np.deg2rad(part.dead_centre_deg))
            spring[:] = part.stiffness, part.preload, *radii, dead_centre, part.lateral, part.shortest
        self.masses = Masses(
            mass=np.array([link.mass for link in links] + [1.0]),
            centres=np.array([link.center_of_mass for link in [*links, payload]], dtype=float),
            inertia=np.array(inertia, dtype=float),
            axes=np.array(axes, dtype=float),
            spring=spring,
        )

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
        loads = np.empty((len(frames), NUM_SETS, 18))
        kernels.loads.load_all(self.masses, frames, q, velocity, acceleration, loads)
        return loads

    def inertias(self, frames: np.ndarray, q: np.ndarray, load: np.ndarray) -> np.ndarray:
        """What each joint turns behind its gear in kg m^2, (6,), while the others stand.

        Args:
            frames: of one posture, as of `at`, (7, 4, 4).
            q: of the joints there, (6,).
            load: mass in kg, and first moment along the axes of the flange in kg m, (4,).
        """
        n = len(q)
        each = np.eye(n + 1)[:, 1:]  # rad/s^2: none, then one joint after the other
        rows = np.repeat(frames[None], n + 1, axis=0), np.tile(q, (n + 1, 1)), np.zeros((n + 1, n)), each
        torque = np.append(1.0, load) @ self.at(*rows)[..., :n]
        return np.diag(torque[1:] - torque[0]).copy()

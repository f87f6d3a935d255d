"""Equations of an arm as functions of casadi, whatever its bodies are: M(x) x'' + b(x, x') = B u."""

from typing import NamedTuple

import casadi as ca
import numpy as np

GRAVITY = 9.81  # m/s^2
_NEWTON_STEPS = 8  # of a sag that is nearly linear


class Terms(NamedTuple):
    """Which terms a body has in a model, of those that Reiner (2010), (3.72), names."""

    coupling: bool = True  # C_t and C_r: what the motion of the frame does to the modes, and they to it
    modal_weight: bool = True  # what gravity does to the modes by C_t, part of h_e
    gyroscopic: bool = True  # G_r, G_e, and O_e of first order in the deformation
    bent_inertia: bool = True  # inertia and centre of mass of the bent body
    bent_coupling: bool = True  # C_r of first order in the deformation; in a plane there is none


NOMINAL = Terms()
# Of section 3.7, by what they leave out; the first one is (3.73).
VARIANTS = {
    "1": Terms(False, False, False, False),
    "2": Terms(False, False, False),
    "3": Terms(False, False),
    "4": Terms(False),
    "5": Terms(bent_coupling=False),
}


class Motion(NamedTuple):
    """Symbols of the coordinates and their two derivatives."""

    x: ca.SX
    v: ca.SX
    a: ca.SX

    def rate(self, quantity: ca.SX) -> ca.SX:
        """The derivative by time of what depends on x and v."""
        return ca.jtimes(quantity, self.x, self.v) + ca.jtimes(quantity, self.v, self.a)


def motion_symbols(size: int) -> Motion:
    """Of so many coordinates."""
    return Motion(*(ca.SX.sym(name, size) for name in "xva"))


class ArmEquations:
    """Coordinates x are angles of joints (rad) and amplitudes of modes; the arm begins at a base at rest.

    Attributes:
        size: number of coordinates.
        joints: which of them are angles.
        modes: which belong to modes.
        B: what the torques of the joints act on, shape (size, joints).
        held: by which coordinates the modes change with the joints held, shape (size, modes).
        mass, bias, tangent: M of x, b of x and v, and how b changes with x at rest.
        energy: of x and v in J.
        end: of x and v, where the end is (m), its Jacobian, and how it accelerates at x'' = 0.
    """

    def __init__(
        self,
        motion: Motion,
        forces: ca.SX,
        energy: ca.SX,
        end: ca.SX,
        joints: np.ndarray,
        root_turns: np.ndarray,
    ) -> None:
        """Makes functions of expressions.

        Args:
            motion: the symbols.
            forces: generalised forces that the motion takes, linear in the accelerations.
            energy: kinetic and potential.
            end: place of the end in m.
            joints: which coordinates are angles.
            root_turns: how far each coordinate turns the start of its body against the angle of its joint, in
                rad, shape (size, joints); zero for clamped modes.
        """
        x, v, a = motion
        self.size, self.joints = x.numel(), joints
        self.modes = np.setdiff1d(np.arange(self.size), joints)
        self._turns = np.eye(self.size)[:, joints]
        self.B = self._turns + root_turns
        self.held = np.eye(self.size)[:, self.modes] - self._turns @ root_turns[self.modes].T
        bias = ca.substitute(forces, a, ca.DM.zeros(self.size))
        static = ca.substitute(bias, v, ca.DM.zeros(self.size))
        at_once = {"cse": True}
        self.mass = ca.Function("mass", [x], [ca.jacobian(forces, a)], at_once)
        self.bias = ca.Function("bias", [x, v], [bias], at_once)
        self.energy = ca.Function("energy", [x, v], [energy], at_once)
        self.tangent = ca.Function("tangent", [x], [ca.jacobian(static, x)], at_once)
        rate = ca.jtimes(end, x, v)
        self.end = ca.Function("end", [x, v], [end, ca.jacobian(end, x), ca.jtimes(rate, x, v)], at_once)

    def at_rest(self, angles: np.ndarray) -> np.ndarray:
        """Coordinates with the joints held at angles in rad, shape (joints,), and what gravity bends."""
        q, still = np.zeros(len(self.modes)), np.zeros(self.size)
        for _ in range(_NEWTON_STEPS if len(q) else 0):
            x = self._turns @ angles + self.held @ q
            sag = self.held.T @ np.asarray(self.bias(x, still))[:, 0]
            q = q - np.linalg.solve(self.held.T @ np.asarray(self.tangent(x)) @ self.held, sag)
        return self._turns @ angles + self.held @ q

    def torques(self, x: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Of a motion, M a + b in all coordinates: x and its two derivatives of shape (k, size) each."""
        M = np.asarray(self.mass.map(len(x))(x.T)).reshape(self.size, len(x), self.size)
        return np.einsum("ikj,kj->ki", M, a) + np.asarray(self.bias.map(len(x))(x.T, v.T)).T

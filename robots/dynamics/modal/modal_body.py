"""A body in space whose deformation is a sum of modes in a moving frame, by integrals of their products.

With the place c of a mass element in the frame, its displacement u = sum phi_k(c) q_k and r = c + u, all
integrals of the standard input data (Wallrapp (1994); Reiner (2010), eq. (3.72)) are made of moments, the
matrices of c c^T, c phi_k^T and phi_k phi_l^T over the mass: J of the symmetric part of the first, C_r of the
skew part of the second, O_e of its symmetric part.
"""

from dataclasses import dataclass, field

import numpy as np

from robots.dynamics.modal.flexible_body import FlexibleBody


@dataclass(frozen=True)
class ModalBody:
    """A body with n modes that do not move the origin of its frame; rigid where n = 0.

    Attributes:
        mass: in kg.
        first_moment: mass times centre of mass in kg m, shape (3,).
        second_moment: of c c^T in kg m^2, shape (3, 3).
        end: where the next body begins, in m, shape (3,).
        Ct: of phi_k, shape (n, 3).
        moments: of c phi_k^T, shape (n, 3, 3).
        modal_moments: of phi_k phi_l^T, shape (n, n, 3, 3); zero leaves out what is of second order.
        Me, Ke, De: mass, stiffness and damping of the modes, shape (n, n).
        end_shift, end_turn: how far the modes move (m) and turn (rad) the end, shape (3, n).
    """

    mass: float
    first_moment: np.ndarray
    second_moment: np.ndarray
    end: np.ndarray = field(default_factory=lambda: np.zeros((3,)))
    Ct: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    moments: np.ndarray = field(default_factory=lambda: np.zeros((0, 3, 3)))
    modal_moments: np.ndarray = field(default_factory=lambda: np.zeros((0, 0, 3, 3)))
    Me: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    Ke: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    De: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    end_shift: np.ndarray = field(default_factory=lambda: np.zeros((3, 0)))
    end_turn: np.ndarray = field(default_factory=lambda: np.zeros((3, 0)))

    @property
    def inertia(self) -> np.ndarray:
        """J about the frame's origin in kg m^2, shape (3, 3)."""
        return np.trace(self.second_moment) * np.eye(3) - self.second_moment

    @property
    def Cr(self) -> np.ndarray:  # noqa: N802 - its name in standard input data
        """Angular momentum of the modes, shape (n, 3)."""
        P = self.moments
        return np.stack([P[:, i, j] - P[:, j, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)

    @property
    def Oe(self) -> np.ndarray:  # noqa: N802 - likewise
        """What turning does to the modes, shape (n, 6); by the products of rates in the order of (3.72b)."""
        P = self.moments
        diagonal = np.einsum("kii->ki", P)
        products = np.stack([P[:, i, j] + P[:, j, i] for i, j in ((0, 1), (1, 2), (0, 2))], axis=1)
        return np.hstack([diagonal - diagonal.sum(axis=1, keepdims=True), products])

    def frequencies(self) -> np.ndarray:
        """Natural frequencies with the frame held, in rad/s, shape (n,)."""
        return np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(self.Me, self.Ke)).real))

    @property
    def rigid(self) -> "ModalBody":
        """The same without modes."""
        return ModalBody(self.mass, self.first_moment, self.second_moment, self.end)


def rigid_body(
    mass: float, center: np.ndarray | tuple[float, ...], inertia: np.ndarray, end: np.ndarray | None = None
) -> ModalBody:
    """A body without modes.

    Args:
        mass: in kg.
        center: of mass in m, shape (3,).
        inertia: about it in kg m^2, shape (3, 3).
        end: where the next body begins, in m; at the frame if it is not given.

    Raises:
        ValueError: if no mass can be distributed so.
    """
    of_mass = 0.5 * np.trace(inertia) * np.eye(3) - np.asarray(inertia)
    if not mass >= 0.0 or np.linalg.eigvalsh(of_mass).min() < -1e-9 * max(np.trace(of_mass), 1e-300):
        raise ValueError(f"modal body: no body has {mass:g} kg with moments of inertia {np.diag(inertia)}")
    c = np.asarray(center, dtype=float)
    return ModalBody(
        mass, mass * c, of_mass + mass * np.outer(c, c), np.zeros(3) if end is None else np.asarray(end)
    )


def body_of_file(body: FlexibleBody) -> ModalBody:
    """A body of standard input data, clamped at its first node; the next one begins at its last.

    Raises:
        ValueError: if it is not clamped there, or does not say how far the modes turn its nodes or what
            turning does to the modes.
    """
    if body.turns is None or body.Oe is None:
        lacking = "how far its modes turn its nodes (psi)" if body.turns is None else "O_e"
        raise ValueError(f"modal body: the standard input data do not say {lacking}")
    size = np.abs(body.shapes).max()
    if np.abs(body.places[0]).max() > 1e-9 * np.abs(body.places).max() or (
        max(np.abs(body.shapes[0]).max(), np.abs(body.turns[0]).max()) > 1e-9 * size
    ):
        raise ValueError("modal body: the first node must be at the frame, and no mode may move or turn it")
    n = len(body.Ct)
    diagonal, products = body.Oe[:, :3], body.Oe[:, 3:]
    P = np.zeros((n, 3, 3))
    P[:, range(3), range(3)] = diagonal - 0.5 * diagonal.sum(axis=1, keepdims=True)
    for (i, j), product, skew in zip(
        ((1, 2), (2, 0), (0, 1)), products[:, [1, 2, 0]].T, body.Cr.T, strict=True
    ):
        P[:, i, j], P[:, j, i] = 0.5 * (product + skew), 0.5 * (product - skew)
    return ModalBody(
        body.mass,
        body.first_moment,
        0.5 * np.trace(body.inertia) * np.eye(3) - body.inertia,
        body.places[-1],
        body.Ct,
        P,
        np.zeros((n, n, 3, 3)),
        body.Me,
        body.Ke,
        body.De,
        body.shapes[-1],
        body.turns[-1],
    )

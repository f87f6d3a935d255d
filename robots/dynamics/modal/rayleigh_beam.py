"""A uniform beam in space: it bends in two planes and twists, and its sections have inertia.

Reiner (2010), section 2.4.2: sections stay plane and square to the bent line (Rayleigh). A mass element at
(x, y, z) is displaced by phi = A(x) + y B(x) + z C(x), so that all integrals are those along the beam.
"""

from dataclasses import dataclass

import numpy as np

from robots.dynamics.modal.modal_beam import ModalBeam
from robots.dynamics.modal.modal_body import ModalBody

_QUADRATURE_NODES = 96  # as of the modes of a plane beam
_MOST_MODES = 12


@dataclass(frozen=True)
class RayleighBeam:
    """A beam along x, clamped to its frame.

    Attributes:
        length: in m.
        mass: in kg.
        bending_stiffness: E I against bending along y and along z, in N m^2.
        torsional_stiffness: G J in N m^2.
        radii: of gyration of the section along y and z, in m.
        modes: how many bend along y, bend along z and twist; 0 to 12 each.
        damping: of each mode, relative to the critical one.
    """

    length: float = 1.0
    mass: float = 1.0
    bending_stiffness: tuple[float, float] = (1.0, 1.0)
    torsional_stiffness: float = 1.0
    radii: tuple[float, float] = (0.02, 0.02)
    modes: tuple[int, int, int] = (2, 2, 2)
    damping: float = 0.0

    def __post_init__(self) -> None:
        """Checks the numbers.

        Raises:
            ValueError: if one of them is impossible.
        """
        for name in ("length", "mass", "bending_stiffness", "torsional_stiffness"):
            if not np.min(getattr(self, name)) > 0.0:
                raise ValueError(f"beam: {name} must be positive, got {getattr(self, name)}")
        for name in ("radii", "damping"):
            if not np.min(getattr(self, name)) >= 0.0:
                raise ValueError(f"beam: {name} must not be negative, got {getattr(self, name)}")
        if not 0 <= min(self.modes) <= max(self.modes) <= _MOST_MODES:
            raise ValueError(f"beam: modes must be 0 to {_MOST_MODES} each, got {self.modes}")
        if self.modes[2] and not max(self.radii) > 0.0:
            raise ValueError("beam: a beam that twists needs radii above zero")

    def body(self) -> ModalBody:
        """Its standard input data."""
        nodes, weights = np.polynomial.legendre.leggauss(_QUADRATURE_NODES)
        fields = self._fields(0.5 * (nodes + 1.0))
        end = self._fields(np.ones(1))[1:, 0]
        # Sections are symmetric: products of 1, y and z have no mixed integrals.
        of_section = np.array([1.0, self.radii[0] ** 2, self.radii[1] ** 2])
        products = np.einsum("s,p,kspi,lspj->klij", 0.5 * self.mass * weights, of_section, fields, fields)
        sums = 0.5 * self.mass * np.einsum("s,ksi->ki", weights, fields[:, :, 0])
        Me, Ke = np.einsum("klii->kl", products[1:, 1:]), self._stiffness()
        # A turn w moves y by w x (0, y, 0) and z by w x (0, 0, z).
        turns = np.stack([end[:, 1, 2], end[:, 2, 0], -end[:, 1, 0]])
        return ModalBody(
            self.mass,
            sums[0],
            products[0, 0],
            np.array([self.length, 0.0, 0.0]),
            sums[1:],
            products[0, 1:],
            products[1:, 1:],
            Me,
            Ke,
            np.diag(2.0 * self.damping * np.sqrt(np.diag(Ke) * np.diag(Me))),
            end[:, 0].T,
            turns,
        )

    def _bending(self, axis: int) -> ModalBeam:
        return ModalBeam(self.length, self.mass, self.bending_stiffness[axis], 0.0, max(self.modes[axis], 1))

    def _fields(self, xi: np.ndarray) -> np.ndarray:
        """Places and modes at xi: A, B and C of each; shape (1 + n, len(xi), 3, 3), the components last."""
        along_y, along_z, _ = self.modes
        fields = np.zeros((1 + sum(self.modes), len(xi), 3, 3))
        fields[0, :, 0, 0], fields[0, :, 1, 1], fields[0, :, 2, 2] = self.length * xi, 1.0, 1.0
        # A section turned about z moves what is at y along -x, one turned about y what is at z.
        for first, count, axis in ((1, along_y, 0), (1 + along_y, along_z, 1)):
            if count:
                own, beam = slice(first, first + count), self._bending(axis)
                fields[own, :, 0, 1 + axis] = beam.displacement(xi)[:, 1:].T
                fields[own, :, 1 + axis, 0] = -beam.slope(xi).T
        angle = np.sin(np.outer(self._waves(), xi))
        twisted = fields[1 + along_y + along_z :]
        twisted[:, :, 1, 2], twisted[:, :, 2, 1] = angle, -angle
        return fields

    def _waves(self) -> np.ndarray:
        """Of modes of torsion, clamped and free, per length."""
        return np.pi * (np.arange(self.modes[2]) + 0.5)

    def _stiffness(self) -> np.ndarray:
        along_y, along_z, _ = self.modes
        stiffness = np.zeros((sum(self.modes), sum(self.modes)))
        for first, count, axis in ((0, along_y, 0), (along_y, along_z, 1)):
            if count:
                own = slice(first, first + count)
                stiffness[own, own] = self._bending(axis).stiffness_matrix()[1:, 1:]
        twist = np.arange(along_y + along_z, sum(self.modes))
        stiffness[twist, twist] = 0.5 * self.torsional_stiffness / self.length * self._waves() ** 2
        return stiffness

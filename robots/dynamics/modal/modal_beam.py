"""One driven joint with an elastic beam behind it and a load at its end, as mode shapes in a moving frame.

The deformation is a sum of the bending modes of the beam, w(x, t) = sum phi_i(x) q_i(t), in a frame that the
joint turns: Reiner (2010), section 2.4.2, with an Euler-Bernoulli beam in place of Rayleigh's. For small
motions about rest, M x'' + K x = B u with x = (angle of the joint, q_1 .. q_n).

Drake's continuous MultibodyPlant has no body whose deformation is a field, so this stands beside it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import root_scalar

from robots.dynamics.transmission_zeros import Zeros, transmission_zeros

BOUNDARIES = ("clamped", "supported")
_MOST_MODES = 12  # cosh of the next eigenvalues leaves too few digits of the mode at the free end
_QUADRATURE_NODES = 96  # integrates products of twelve modes to rounding

Field = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class ModalBeam:
    """A uniform beam on a driven joint.

    Attributes:
        length: in m.
        mass: of the beam in kg.
        bending_stiffness: E I in N m^2.
        load: a point mass at the free end in kg.
        num_modes: bending modes, 1 to 12.
        boundary: ``"clamped"``, modes of a beam clamped to the joint and free at its end, in the frame of
            the joint; or ``"supported"``, of one that is supported and free, whose own slope at the joint
            adds to the angle.
    """

    length: float = 1.0
    mass: float = 1.0
    bending_stiffness: float = 1.0
    load: float = 0.45
    num_modes: int = 1
    boundary: str = "clamped"

    def __post_init__(self) -> None:
        """Checks the numbers.

        Raises:
            ValueError: if one of them is impossible.
        """
        for name in ("length", "mass", "bending_stiffness"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"beam: {name} must be positive, got {getattr(self, name)}")
        if not self.load >= 0.0:
            raise ValueError(f"beam: load must not be negative, got {self.load} kg")
        if not 1 <= self.num_modes <= _MOST_MODES:
            raise ValueError(f"beam: num_modes must be between 1 and {_MOST_MODES}, got {self.num_modes}")
        if self.boundary not in BOUNDARIES:
            raise ValueError(f"beam: boundary must be one of {', '.join(BOUNDARIES)}, got '{self.boundary}'")

    def mass_matrix(self) -> np.ndarray:
        """M in kg m^2, kg m and kg; shape (1 + n, 1 + n), the joint first."""
        nodes, weights = _quadrature()
        rows = self.displacement(nodes)
        end = self.displacement(np.ones(1))
        return self.mass * (rows * weights[:, None]).T @ rows + self.load * end.T @ end

    def stiffness_matrix(self) -> np.ndarray:
        """K in N m / rad and N / m; shape (1 + n, 1 + n). The joint itself has none."""
        nodes, weights = _quadrature()
        curvature = np.array([np.zeros_like(nodes), *(second(nodes) for _, _, second in self._modes())]).T
        curvature = curvature / self.length**2
        return self.bending_stiffness * self.length * (curvature * weights[:, None]).T @ curvature

    def input_column(self) -> np.ndarray:
        """What the torque of the joint acts on: angle and slope of the modes at it; shape (1 + n, 1)."""
        return np.concatenate([[1.0], self.slope(0.0)])[:, None]

    def displacement(self, xi: ArrayLike) -> np.ndarray:
        """Displacement across the beam by the coordinates x, at xi = 0 (joint) to 1 (end); (..., 1 + n)."""
        places = np.asarray(xi, dtype=float)
        return np.stack([self.length * places, *(shape(places) for shape, _, _ in self._modes())], axis=-1)

    def slope(self, xi: ArrayLike) -> np.ndarray:
        """How far the modes turn the beam at xi in rad, shape (..., n)."""
        places = np.asarray(xi, dtype=float)
        return np.stack([first(places) for _, first, _ in self._modes()], axis=-1) / self.length

    def frequencies(self) -> np.ndarray:
        """Natural frequencies with the joint held, in rad/s; shape (n,); meant for ``"clamped"``."""
        squared = np.linalg.eigvals(
            np.linalg.solve(self.mass_matrix()[1:, 1:], self.stiffness_matrix()[1:, 1:])
        )
        return np.sqrt(np.sort(squared.real))

    def zeros(self, xi: float) -> Zeros:
        """From the torque of the joint to the displacement at xi, Reiner (2010), section 3.5.1."""
        return self._zeros()(xi)

    def decoupled_zeros(self, xi: float = 1.0, load_coupled: bool = True) -> Zeros:
        """The same where the model neglects that turning the joint bends the beam; Reiner (2010), 3.7.

        In the linear equations about rest this is C_r of the standard input data (C_t of a beam whose base
        moves): what the masses of the beam do to its modes. The approximation (3.73) leaves it out, which
        makes the inverse stable.

        Args:
            xi: where the output is, 0 to 1.
            load_coupled: whether the load, a body of its own, still bends the beam.

        Raises:
            ValueError: if the modes are those of a supported beam, whose frame does not turn with the joint.
        """
        if self.boundary != "clamped":
            raise ValueError("beam: only clamped modes can be decoupled from the joint")
        M, K, B = self.mass_matrix(), self.stiffness_matrix(), self.input_column()
        end = self.displacement(1.0)
        M[1:, 0] = self.load * end[1:] * end[0] if load_coupled else 0.0
        return transmission_zeros(M, np.zeros_like(M), K, B, self.displacement(xi)[None])

    def _zeros(self) -> Callable[[float], Zeros]:
        """`zeros` as a function of xi alone: the matrices do not depend on it."""
        M, K, B = self.mass_matrix(), self.stiffness_matrix(), self.input_column()
        D = np.zeros_like(M)
        return lambda xi: transmission_zeros(M, D, K, B, self.displacement(xi)[None])

    def largest_stable_xi(self, tolerance: float = 1e-5) -> float:
        """Up to which xi the exact inverse is stable; 1 if it is for the whole beam.

        The first output, seen from the joint, with a zero in the right half-plane: a scan in steps of 1/400
        and bisection.
        """
        grid, zeros = np.linspace(0.0025, 1.0, 400), self._zeros()
        stable = grid[0]
        for xi in grid:
            if not zeros(xi).is_minimum_phase:
                break
            stable = xi
        else:
            return 1.0
        unstable = xi
        while unstable - stable > tolerance:
            middle = 0.5 * (stable + unstable)
            stable, unstable = (middle, unstable) if zeros(middle).is_minimum_phase else (stable, middle)
        return float(stable)

    def _modes(self) -> list[tuple[Field, Field, Field]]:
        """Shape of each mode and its first two derivatives by xi."""
        make = _clamped_mode if self.boundary == "clamped" else _supported_mode
        return [make(number) for number in range(1, self.num_modes + 1)]


@cache
def _quadrature() -> tuple[np.ndarray, np.ndarray]:
    nodes, weights = np.polynomial.legendre.leggauss(_QUADRATURE_NODES)
    return 0.5 * (nodes + 1.0), 0.5 * weights


@cache
def _clamped_mode(number: int) -> tuple[Field, Field, Field]:
    """cos(b) cosh(b) = -1."""
    about = (number - 0.5) * np.pi
    b = root_scalar(lambda b: np.cos(b) + 1.0 / np.cosh(b), bracket=(about - 0.6, about + 0.6)).root
    s = (np.cosh(b) + np.cos(b)) / (np.sinh(b) + np.sin(b))

    def shape(x: np.ndarray) -> np.ndarray:
        return np.cosh(b * x) - np.cos(b * x) - s * (np.sinh(b * x) - np.sin(b * x))

    def first(x: np.ndarray) -> np.ndarray:
        return b * (np.sinh(b * x) + np.sin(b * x) - s * (np.cosh(b * x) - np.cos(b * x)))

    def second(x: np.ndarray) -> np.ndarray:
        return b**2 * (np.cosh(b * x) + np.cos(b * x) - s * (np.sinh(b * x) + np.sin(b * x)))

    return shape, first, second


@cache
def _supported_mode(number: int) -> tuple[Field, Field, Field]:
    """tan(b) = tanh(b)."""
    about = (number + 0.25) * np.pi
    b = root_scalar(lambda b: np.tan(b) - np.tanh(b), bracket=(about - 0.3, about + 0.3)).root
    s = np.sin(b) / np.sinh(b)

    def shape(x: np.ndarray) -> np.ndarray:
        return np.sin(b * x) + s * np.sinh(b * x)

    def first(x: np.ndarray) -> np.ndarray:
        return b * (np.cos(b * x) + s * np.cosh(b * x))

    def second(x: np.ndarray) -> np.ndarray:
        return b**2 * (-np.sin(b * x) + s * np.sinh(b * x))

    return shape, first, second

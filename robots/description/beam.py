"""A long link as an elastic beam, approximated by a few rigid segments with sprung hinges between them.

Two surrogates of Reiner (2010), section 2.4.3, for a beam that is clamped at its start:

Five degrees of freedom (figure 2.10, eq. (2.23)): the hinges stand at the two points of Gauss's quadrature,
k l and l - k l, two bending axes each, and torsion in the middle. A hinge has the stiffness of the half of
the beam that it stands for, 2 EI / l. Because the quadrature integrates squares exactly, deflection and slope
of the end under any force and moment at the end are those of the Euler-Bernoulli cantilever.

Three degrees of freedom (figures 2.11, 2.12): one hinge of stiffness 3 EI / l at the clamp and, at the
end, a dependent rotation by gamma = 1/2 of its angle phi. A continuous `MultibodyPlant` has no dependent
joints. But to first order, a rotation by 3/2 phi about the point l / 3 moves the end by the same l phi and
turns it by the same 3/2 phi. So the surrogate here has its hinge at l / 3, with 3 EI / l divided by (3/2)^2.
Deflection and slope under a force at the end, and the deflection under a moment, are exact; the slope under
a moment is 3/4 of the right one.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from robots.description.drive_parts import Cubic, Exponential, Limited
from robots.drivetrain.stiffness import GearSpring

_GAUSS = 0.5 * (1.0 - 1.0 / math.sqrt(3.0))  # k of eq. (2.23a)
# Where the beam is cut, in shares of its length.
_CUTS = {5: (_GAUSS, 0.5, 1.0 - _GAUSS), 3: (1.0 / 3.0,)}
_AXES = "xyz"


@dataclass
class Beam:
    """The elasticity of a link that is a straight hollow beam along one axis of its frame.

    Mass, centre of mass and inertia are those of the link, so that the undeformed robot is the rigid one.
    """

    along: str = "x"  # axis of the link's frame
    start: float = 0.0  # m, coordinate on that axis where the beam is clamped
    length: float = 0.0  # m
    # N m^2 about the link's x, y, z: torsion GI about the beam's own axis, bending EI about the others.
    stiffness: np.ndarray = field(default_factory=lambda: np.zeros(3))
    retardation_time: float = 0.0  # s, damping over stiffness of every hinge
    degrees_of_freedom: int = 5  # or 3
    stiffening_x: Cubic | Exponential | Limited | None = None  # of every hinge about x; left out: linear
    stiffening_y: Cubic | Exponential | Limited | None = None  # about y
    stiffening_z: Cubic | Exponential | Limited | None = None  # about z
    source: str = ""  # where the numbers come from, or ``assumed``

    @property
    def stiffening(self) -> tuple[Cubic | Exponential | Limited | None, ...]:
        """Of hinges about x, y and z."""
        return self.stiffening_x, self.stiffening_y, self.stiffening_z


@dataclass(frozen=True)
class Segment:
    """A rigid piece of a beam, in the axes of the link."""

    mass: float  # kg
    center_of_mass: np.ndarray  # m, in the link's frame, shape (3,)
    inertia: np.ndarray  # kg m^2, principal moments about its own centre of mass, shape (3,)
    start: float  # m, coordinate along the beam
    end: float  # m


@dataclass(frozen=True)
class Hinge:
    """A sprung rotation between a segment and the next one."""

    name: str  # as in figure 2.10: y1, z1, x, y2, z2
    segment: int  # index of the segment before it
    position: np.ndarray  # m, in the link's frame, shape (3,)
    axis: np.ndarray  # unit vector in the link's frame, shape (3,)
    spring: GearSpring
    damping: float  # N m s / rad

    @property
    def stiffness(self) -> float:
        """At rest, in N m / rad."""
        return float(self.spring.c_0)


@dataclass(frozen=True)
class BeamSurrogate:
    """Segments from the clamped start to the free end, and hinges in the same order."""

    segments: tuple[Segment, ...]
    hinges: tuple[Hinge, ...]


def beam_surrogate(beam: Beam, mass: float, center_of_mass: np.ndarray, inertia: np.ndarray) -> BeamSurrogate:
    """Splits a link into segments and hinges that conserve its mass, centre of mass and inertia.

    Reiner (2010), eqs. (2.23), (2.24), corrected. The source conserves the sum of the two moments across the
    beam; here each of the two has its own substitute radius, so that both are conserved.

    Args:
        beam: the elasticity.
        mass: of the link in kg.
        center_of_mass: of the link in its frame in m, shape (3,); it may lie beside the beam.
        inertia: principal moments of the link about its centre of mass in kg m^2, shape (3,).

    Raises:
        ValueError: if no such segments exist, or a parameter of the beam is out of its range.
    """
    _check(beam)
    u = _AXES.index(beam.along)
    along, length = np.eye(3)[u], beam.length
    cuts = np.array([0.0, *_CUTS[beam.degrees_of_freedom], 1.0])
    shares, centers = np.diff(cuts), 0.5 * (cuts[1:] + cuts[:-1]) * length
    eccentricity = center_of_mass[u] - beam.start - 0.5 * length
    # (2.23g): mass that moves from the last segment to the first puts the centre of mass where it is.
    masses = mass * shares
    moved = -mass * eccentricity / (centers[-1] - centers[0])
    masses[0], masses[-1] = masses[0] + moved, masses[-1] - moved
    if masses.min() <= 0.0:
        raise ValueError(
            f"beam: the centre of mass must lie within {1e3 * _reach(shares, centers):.1f} mm of the middle "
            f"of the beam, got {1e3 * eccentricity:.1f} mm"
        )
    # (2.24c) for any cuts: what the segments have by their lengths and places, the radius must complete.
    asymmetry = centers[0] + centers[-1] - length
    by_length = length**2 / 12.0 + eccentricity * asymmetry - eccentricity**2
    radius_squared = 2.0 * (inertia / mass - by_length)
    radius_squared[u] = 0.0
    if radius_squared.min() < 0.0:
        smallest = mass * by_length
        raise ValueError(
            f"beam: the square of the substitute radius must not be negative, got "
            f"{radius_squared.min():.6g} m^2; across a beam of {mass:g} kg and {length:g} m the inertia must "
            f"be at least {smallest:.6g} kg m^2, got {np.delete(inertia, u).min():.6g}"
        )
    segments = []
    for share, center, own_mass, start, end in zip(
        shares, centers, masses, cuts[:-1] * length, cuts[1:] * length, strict=True
    ):
        moments = share * mass * ((share * length) ** 2 / 12.0 + 0.5 * radius_squared)  # (2.24d), (2.24e)
        moments[u] = share * inertia[u]
        _check_moments(moments, start, end)
        p = np.array(center_of_mass, dtype=float)
        p[u] = beam.start + center
        segments.append(
            Segment(float(own_mass), p, moments, beam.start + float(start), beam.start + float(end))
        )
    return BeamSurrogate(tuple(segments), _hinges(beam, u, along))


def _hinges(beam: Beam, u: int, along: np.ndarray) -> tuple[Hinge, ...]:
    across = [axis for axis in range(3) if axis != u]
    length, stiffness = beam.length, beam.stiffness

    def hinge(name: str, segment: int, axis: int, value: float) -> Hinge:
        position = (beam.start + _CUTS[beam.degrees_of_freedom][segment] * length) * along
        damping = beam.retardation_time * value
        stiffening = beam.stiffening[axis] or Cubic()
        spring = stiffening.spring(float(value))
        return Hinge(name, segment, position, np.eye(3)[axis], spring, float(damping))

    torsion = stiffness[u] / length
    if beam.degrees_of_freedom == 3:
        # 3 EI / l at the clamp, seen from the hinge at l / 3 that turns 3/2 times as far.
        bends = [hinge(_AXES[axis], 0, axis, 4.0 / 3.0 * stiffness[axis] / length) for axis in across]
        return (*bends, hinge(_AXES[u], 0, u, torsion))
    first, second = (
        [hinge(f"{_AXES[axis]}{number}", gap, axis, 2.0 * stiffness[axis] / length) for axis in across]
        for number, gap in ((1, 0), (2, 2))
    )
    return (*first, hinge(_AXES[u], 1, u, torsion), *second)


def _check(beam: Beam) -> None:
    if beam.along not in tuple(_AXES):
        raise ValueError(f"beam: along must be one of x, y, z, got '{beam.along}'")
    if beam.degrees_of_freedom not in _CUTS:
        raise ValueError(f"beam: degrees_of_freedom must be 3 or 5, got {beam.degrees_of_freedom}")
    if not beam.length > 0.0:
        raise ValueError(f"beam: length must be positive, got {beam.length} m")
    if not beam.stiffness.min() > 0.0:
        raise ValueError(f"beam: stiffness must be positive, got {beam.stiffness.tolist()} N m^2")
    if beam.retardation_time < 0.0:
        raise ValueError(f"beam: retardation_time must not be negative, got {beam.retardation_time} s")


def _check_moments(moments: np.ndarray, start: float, end: float) -> None:
    # The moment about the beam's own axis is shared out by length, so a body that is no tube can ask for too
    # much of a short segment.
    if not (moments.min() > 0.0 and 2.0 * moments.max() <= moments.sum() * (1.0 + 1e-9)):
        raise ValueError(
            f"beam: its segment from {start:g} to {end:g} m would need the moments of inertia "
            f"{moments.round(6).tolist()} kg m^2, which no body has; the link is no hollow beam"
        )


def _reach(shares: np.ndarray, centers: np.ndarray) -> float:
    """How far in m the centre of mass may be off the middle."""
    return float(min(shares[0], shares[-1]) * (centers[-1] - centers[0]))

"""The elastic structure of a robot: tilting bearings and bending links as sprung joints.

All bodies of a link have their frames where the frame of the rigid link would be, as long as nothing is
deformed. So centres of mass, hinges and the next joint are given in the frame of the link, whichever body
they belong to.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    RevoluteJoint,
    RevoluteSpring,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
    UnitInertia,
)

from robots.description.beam import beam_surrogate
from robots.description.model import Joint, Link
from robots.drivetrain.stiffness import CubicSpring, GearSpring, SpringRow


@dataclass
class SprungJoints:
    """Revolute joints with a spring and a damper each, from the base to the tool."""

    joints: list[RevoluteJoint] = field(default_factory=list)
    springs: list[RevoluteSpring] = field(default_factory=list)
    characteristics: list[GearSpring] = field(default_factory=list)

    @property
    def stiffening(self) -> SpringRow | None:
        """The characteristics side by side where one of them stiffens under load, None if all are linear."""
        is_linear = all(
            isinstance(spring, CubicSpring) and spring.gamma == 0.0 for spring in self.characteristics
        )
        return None if is_linear else SpringRow(self.characteristics)

    def add(
        self,
        plant: MultibodyPlant,
        name: str,
        frames: tuple[Frame, Frame],
        axis: np.ndarray,
        spring: GearSpring,
        damping: float,
    ) -> None:
        """Adds a joint.

        Args:
            frames: on the body before it and on the one behind it; they coincide at zero.
            axis: direction in both frames, shape (3,).
            spring: of which the plant gets the stiffness at rest.
            damping: in N m s / rad.
        """
        joint = plant.AddJoint(RevoluteJoint(name, *frames, axis, damping))
        self.joints.append(joint)
        self.springs.append(plant.AddForceElement(RevoluteSpring(joint, 0.0, float(spring.c_0))))
        self.characteristics.append(spring)

    def extend(self, outer: "SprungJoints") -> None:
        """Appends joints that stand nearer to the tool."""
        self.joints += outer.joints
        self.springs += outer.springs
        self.characteristics += outer.characteristics


def tilting_axes(axis: np.ndarray) -> np.ndarray:
    """Two unit vectors square to a joint's axis and to each other, rows of (2, 3).

    For an axis along x, y or z they are the next two coordinate axes in cyclic order, but for signs.
    """
    n = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    a = np.roll(np.eye(3)[np.argmax(np.abs(n))], 1)
    a = a - n * (n @ a)
    a /= np.linalg.norm(a)
    return np.array([a, np.cross(n, a)])


def add_bearing(
    plant: MultibodyPlant,
    structure: SprungJoints,
    number: int,
    joint: Joint,
    inner: RigidBody,
    link: RigidBody,
) -> None:
    """Puts the springs of a tilting bearing, ``tilt_a_i`` and ``tilt_b_i``, between two bodies.

    Args:
        structure: gets the two joints.
        number: of the robot's joint, from 1.
        joint: with its tilting.
        inner: what the gear turns.
        link: what the bearing carries.
    """
    tilting = joint.tilting
    assert tilting is not None
    between = plant.AddRigidBody(f"bearing_{number}", massless())
    chain, springs = [inner, between, link], tilting.springs()
    for k, axis in enumerate(tilting_axes(joint.axis)):
        frames = chain[k].body_frame(), chain[k + 1].body_frame()
        name = f"tilt_{'ab'[k]}_{number}"
        structure.add(plant, name, frames, axis, springs[k], tilting.damping[k])


def add_rigid_link(
    plant: MultibodyPlant, number: int, link: Link, carried: SpatialInertia | None
) -> tuple[RigidBody, RigidBody]:
    """Adds ``link_i`` as one body with what it carries; returns it twice, as its first and its last body."""
    inertia = link_inertia(link)
    if carried is not None:
        inertia += carried
    body = plant.AddRigidBody(f"link_{number}", inertia)
    return body, body


def add_beam_link(
    plant: MultibodyPlant,
    hinges: SprungJoints,
    number: int,
    link: Link,
    carried: SpatialInertia | None,
) -> tuple[RigidBody, RigidBody]:
    """Adds a link that is a beam: ``link_i``, ``link_i_segment_2``, ... with ``beam_i_y1``, ... between them.

    Args:
        hinges: gets the joints.
        number: of the link, from 1.
        link: with its beam.
        carried: what is fixed to its end, in the frame of the link.

    Returns:
        The clamped body and the one at the free end.
    """
    assert link.beam is not None
    surrogate = beam_surrogate(link.beam, link.mass, link.center_of_mass, link.inertia)
    bodies = []
    for k, segment in enumerate(surrogate.segments, 1):
        inertia = _central(segment.mass, segment.center_of_mass, segment.inertia)
        if k == len(surrogate.segments) and carried is not None:
            inertia += carried
        name = f"link_{number}" if k == 1 else f"link_{number}_segment_{k}"
        bodies.append(plant.AddRigidBody(name, inertia))
    body = bodies[0]
    for k, hinge in enumerate(surrogate.hinges):
        is_last = k + 1 == len(surrogate.hinges) or surrogate.hinges[k + 1].segment != hinge.segment
        name = f"beam_{number}_{hinge.name}"
        # Two hinges at one place need a body between them.
        child = bodies[hinge.segment + 1] if is_last else plant.AddRigidBody(f"{name}_hinge", massless())
        X = RigidTransform(hinge.position)
        before, behind = (
            plant.AddFrame(FixedOffsetFrame(f"{name}_{side}", on.body_frame(), X))
            for side, on in (("before", body), ("behind", child))
        )
        hinges.add(plant, name, (before, behind), hinge.axis, hinge.spring, hinge.damping)
        body = child
    return bodies[0], bodies[-1]


def link_inertia(link: Link) -> SpatialInertia:
    """The inertia of a rigid link about its frame's origin."""
    return _central(link.mass, link.center_of_mass, [*link.inertia, *link.products])


def massless() -> SpatialInertia:
    """Of a body between two joints."""
    return SpatialInertia(0.0, np.zeros(3), UnitInertia(0.0, 0.0, 0.0), skip_validity_check=True)


def _central(
    mass: float, center_of_mass: np.ndarray, inertia: Sequence[float] | np.ndarray
) -> SpatialInertia:
    """From the three moments about the centre of mass, with the products xy, xz, yz if there are any."""
    return SpatialInertia.MakeFromCentralInertia(
        mass, center_of_mass, RotationalInertia(*map(float, inertia))
    )

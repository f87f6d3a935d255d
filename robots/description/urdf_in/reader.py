"""Reads a URDF as what a robot file would say of the same robot.

Drake's parser reads frames, limits, masses and inertias. It is given the six joints alone: others that could
move are fixed, shapes are left out, because Drake refuses packages that it does not find. What URDF does not
hold is `assumed`.
"""

import copy
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, RevoluteJoint, RigidBody, SpatialInertia
from pydrake.systems.framework import Context

from robots.configuration.nodes import ConfigurationError, Node
from robots.configuration.shortest import all_shortest, shortest
from robots.description.placement import placement_entry
from robots.description.urdf_in.assumed import (
    assumed_drive_trains,
    assumed_payload,
    assumed_radius,
    assumed_tilting,
)
from robots.description.urdf_in.chain import NUM_AXES, Chain, UrdfText
from robots.description.urdf_in.masses import add_inertia, assumed_masses, correct_inertias
from robots.description.urdf_in.pictures import Pictures

SUFFIXES = (".urdf", ".xacro")
_LEFT_OUT = {"link": ("visual", "collision"), "joint": ("mimic", "safety_controller", "dynamics")}
_DROPPED = ("gazebo", "transmission", "material", "ros2_control")
_SAMPLES = 200  # configurations among which the largest inertia is looked for
_FULL_TURN = 360.0  # deg, either way, of a joint without limits
_SPEED = 180.0  # deg/s, of a joint that does not say it
_NO_MASS = 1e-9  # kg
_ROUNDING = 1e-14  # of sums over bodies: what is smaller beside the largest is zero
_LARGEST = 100.0  # m, that an arm reaches


@dataclass(frozen=True)
class UrdfRobot:
    """A robot that was read from a URDF."""

    nodes: Node  # what a robot file would say
    chain: Chain
    assumed: list[str] = field(default_factory=list)  # what the URDF does not say
    missing_meshes: list[str] = field(default_factory=list)
    unreadable_meshes: list[str] = field(default_factory=list)  # and why
    corrected: Mapping[str, str] = field(default_factory=dict)  # inertias, by the names of links
    placeholder: float | None = None  # kg, that every link weighs: nobody knows what they do


def is_urdf(name: str) -> bool:
    """Whether a name is that of a URDF."""
    return name.lower().endswith(SUFFIXES)


def read_urdf(
    path: Path,
    label: str,
    base: str = "",
    tip: str = "",
    packages: Mapping[str, Path] | None = None,
    *,
    mass: float | None = None,
    payload: float | None = None,
) -> UrdfRobot:
    """Reads six revolute joints in a row, of any geometry.

    Args:
        path: of the URDF, or of a xacro file whose macros are expanded.
        label: how messages call it.
        base, tip: links whose frames are the world and the tool, see `UrdfText.chain`.
        packages: folders of packages, for meshes; others are looked for above the file.
        mass: of the whole robot in kg, for links that do not say theirs, or all say the same.
        payload: the largest that it carries in kg; None for what robots of its mass carry.

    Raises:
        ConfigurationError: if it is no such robot, a link is no possible body, or one that moves has no mass
            or inertia, and no mass is given.
    """
    text = UrdfText(path, label)
    corrected = correct_inertias(text)
    chain = text.chain(base, tip)
    arm = _Arm(text, chain, payload, corrected)
    placeholder = arm.placeholder
    if mass is not None:
        arm, placeholder = _Arm(text, chain, payload, corrected, arm.share(mass)), None
    pictures = Pictures(text, packages or {})
    tree = arm.entries(pictures)
    assumed = ["gears, motors and friction", "bearings", *(["payload"] if payload is None else [])]
    assumed += arm.assumed
    meshes = pictures.missing, pictures.unreadable
    return UrdfRobot(_node(tree, label), chain, assumed, *meshes, corrected, placeholder)


class _Arm:
    """Drake's plant of the six joints."""

    def __init__(
        self,
        text: UrdfText,
        chain: Chain,
        payload: float | None,
        corrected: Collection[str],
        shared: Mapping[int, str] | None = None,
    ) -> None:
        """Has Drake read it.

        Args:
            text, chain, payload: as in `read_urdf`.
            corrected: names of links whose inertia is not that of the file.
            shared: where masses that the URDF does not say are from, by the numbers of links.
        """
        self._text, self._chain, self._payload, self._corrected = text, chain, payload, corrected
        self._shared = shared or {}
        self.assumed = [f"masses of {len(self._shared)} links"] if self._shared else []
        plant = MultibodyPlant(0.0)
        try:
            Parser(plant).AddModelsFromString(_for_drake(text, chain), "urdf")
            root = plant.GetBodyByName(text.root_link)
            if root.index() != plant.world_body().index():
                plant.WeldFrames(plant.world_frame(), root.body_frame())
            plant.Finalize()
        except (RuntimeError, ValueError) as error:  # a ValueError is of a text that is no row of numbers
            reason = " ".join(str(error).split())
            raise ConfigurationError(f"{text.label}: Drake cannot read it: {reason}") from error
        self._plant: MultibodyPlant = plant
        self._context = plant.CreateDefaultContext()
        plant.SetPositions(self._context, np.zeros(NUM_AXES))
        self._joints: list[RevoluteJoint] = [plant.GetJointByName(joint.name) for joint in chain.joints]
        # Of the base and of the six links: the frames, and what is fixed to them.
        names = [chain.joints[0].parent, *(joint.child for joint in chain.joints)]
        self._bodies: list[RigidBody] = [plant.GetBodyByName(name) for name in names]

    @property
    def placeholder(self) -> float | None:
        """The mass in kg of each link, if all that move have the same and the same inertia; else None."""
        inertias = [self._inertia(number).CopyToFullMatrix6() for number in range(1, NUM_AXES + 1)]
        first = inertias[0]
        alike = all(np.allclose(each, first, rtol=1e-9, atol=0.0) for each in inertias)
        return float(first[3, 3]) if alike and first[3, 3] > _NO_MASS else None

    def share(self, mass: float) -> dict[int, str]:
        """Writes masses into the text for links that have none, and says where they are from.

        The same mass of all links, as in files that were made for planning, counts for none.

        Args:
            mass: of the whole robot in kg.

        Raises:
            ConfigurationError: if nothing is left for them.
        """
        known = {number: self._inertia(number).get_mass() for number in range(NUM_AXES + 1)}
        if self.placeholder is not None:
            known.clear()
        try:
            masses = assumed_masses({n: m for n, m in known.items() if m > _NO_MASS}, mass)
        except ValueError as error:
            raise ConfigurationError(f"{self._text.label}: {error}") from error
        ends = [*self._bodies[1:], self._plant.GetBodyByName(self._chain.tip)]
        for number, each in masses.items():
            stretch = self._between(self._bodies[number], ends[number]).translation()
            add_inertia(self._text, self._bodies[number].name(), each, stretch)
        return dict.fromkeys(masses, f"assumed: a share of {mass:g} kg, as a solid cylinder along the link")

    def entries(self, pictures: Pictures) -> dict[str, Any]:
        """What a robot file says of it."""
        plant, chain = self._plant, self._chain
        tip = plant.GetBodyByName(chain.tip)
        X_FE = self._between(self._bodies[-1], tip)
        reach = self._reach()
        source = f"URDF {self._text.path.name}"
        links = [self._link(number, source, reach, pictures) for number in range(NUM_AXES + 1)]
        payload = assumed_payload([link["mass"] for link in links[1:]], X_FE.translation(), self._payload)
        trains = assumed_drive_trains(self._largest_inertia(payload["largest_mass"], tip))
        joints = []
        for number, (joint, train) in enumerate(zip(self._joints, trains, strict=True), 1):
            X = self._between(*self._bodies[number - 1 : number + 1])
            joints.append(
                {
                    "axis": [float(each) for each in joint.revolute_axis()],
                    "placement": placement_entry(X, source),
                    "limits": self._limits(joint, source),
                    "drive_train": train,
                    "tilting": assumed_tilting(train),
                }
            )
        base = self._between(plant.GetBodyByName(chain.base), self._bodies[0])
        return {
            "name": self._text.root.get("name") or self._text.path.stem,
            "base": placement_entry(base, source),
            "joints": joints,
            "tool": placement_entry(X_FE, f"{source}, link {chain.tip}"),
            "base_link": links[0],
            "links": links[1:],
            "payload": payload,
        }

    def _between(self, a: RigidBody, b: RigidBody) -> RigidTransform:
        """The frame of b in that of a, with all joints at zero."""
        return self._plant.CalcRelativeTransform(self._context, a.body_frame(), b.body_frame())

    def _limits(self, joint: RevoluteJoint, source: str) -> dict:
        limits = all_shortest(np.rad2deg([joint.position_lower_limit(), joint.position_upper_limit()]))
        assumed = []
        if not all(map(math.isfinite, limits)):
            limits = [-_FULL_TURN, _FULL_TURN]
            assumed.append("range")
        if not limits[0] < limits[1]:
            raise self._text.refuse(
                f"joint '{joint.name()}': has no range, its limits are {limits[0]:g} and {limits[1]:g} deg",
                joint.name(),
            )
        speed = shortest(np.rad2deg(joint.velocity_upper_limit()))
        if not (math.isfinite(speed) and speed > 0.0):
            speed = _SPEED
            assumed.append("speed")
        self.assumed += [f"{what} of {joint.name()}" for what in assumed]
        source += "".join(f"; {what} assumed" for what in assumed)
        return {"lower_deg": limits[0], "upper_deg": limits[1], "speed_deg_s": speed, "source": source}

    def _link(self, number: int, source: str, reach: float, pictures: Pictures) -> dict:
        """Mass, inertia and pictures of a link with all that is fixed to it; number 0 is the base."""
        body = self._bodies[number]
        welded = self._plant.GetBodiesWeldedTo(body)
        X_of = {each.name(): self._between(body, each) for each in welded}
        # A link named world is Drake's own world, which has no shapes or mass here.
        shapes = [
            entry for name, X in X_of.items() if name in self._text.links for entry in pictures.of(name, X)
        ]
        M = self._inertia(number)
        source = self._shared.get(number, source)
        is_corrected = number not in self._shared and any(name in self._corrected for name in X_of)
        if not M.get_mass() > _NO_MASS:
            if number:
                raise self._text.refuse(
                    f"link '{body.name()}' moves and has no mass or inertia; a simulation needs both. "
                    "With the robot's mass from its data sheet they are assumed: "
                    "truetip robots import --mass KG",
                    body.name(),
                )
            self.assumed.append("mass of the base")
            entry = {"mass": 1.0, "inertia": [0.01] * 3, "source": "assumed", "center_of_mass": [0.0] * 3}
            return entry | {"radius": 0.05 * reach, "radius_source": "assumed", "pictures": shapes}
        p = M.get_com()
        about_center = M.Shift(p).CalcRotationalInertia()
        moments, products = about_center.get_moments(), about_center.get_products()
        principal = np.linalg.eigvalsh(about_center.CopyToFullMatrix3())
        if not principal.min() > 0.0:
            raise self._text.refuse(f"link '{body.name()}' has a mass and no inertia", body.name())
        return {
            "mass": shortest(M.get_mass()),
            "inertia": all_shortest(moments),
            "products": all_shortest(products, _ROUNDING * moments.max()),
            "source": f"{source}; inertia made the nearest that a body can have" if is_corrected else source,
            "center_of_mass": all_shortest(p, _ROUNDING * reach),
            "center_of_mass_source": source,
            "radius": assumed_radius(M.get_mass(), principal, reach),
            "radius_source": "assumed: a solid cylinder of this inertia",
            "pictures": shapes,
        }

    def _inertia(self, number: int) -> SpatialInertia:
        """Of a link with all that is fixed to it, about its origin; number 0 is the base."""
        body, world = self._bodies[number], self._plant.world_body().index()
        indices = [each.index() for each in self._plant.GetBodiesWeldedTo(body) if each.index() != world]
        return self._plant.CalcSpatialInertia(self._context, body.body_frame(), indices)

    def _reach(self) -> float:
        """The sum of the distances from joint to joint and to the tool, from the second joint on, in m."""
        bodies = [*self._bodies[2:], self._plant.GetBodyByName(self._chain.tip)]
        steps = (self._between(*pair).translation() for pair in pairwise(bodies))
        reach = sum(float(np.linalg.norm(step)) for step in steps)
        if reach > _LARGEST:
            raise ConfigurationError(
                f"{self._text.label}: {reach:.4g} m from joint 2 to the tool; lengths of a URDF are in m, "
                "are these in mm?"
            )
        return max(reach, 1e-3)

    def _largest_inertia(self, payload: float, tip: RigidBody) -> np.ndarray:
        """The largest inertia that each joint moves, the payload a point at the tool, (6,) in kg m^2."""
        plant, context = self._plant, self._plant.CreateDefaultContext()
        columns = [joint.velocity_start() for joint in self._joints]
        rng, largest = np.random.default_rng(0), np.zeros(NUM_AXES)
        for q in rng.uniform(-np.pi, np.pi, (_SAMPLES, NUM_AXES)):
            plant.SetPositions(context, q)
            arm = np.diag(plant.CalcMassMatrix(context))[columns]
            largest = np.maximum(largest, arm + payload * self._lever(context, tip)[columns] ** 2)
        return largest

    def _lever(self, context: Context, tip: RigidBody) -> np.ndarray:
        """How far the tool moves in m for each radian of a joint."""
        world = self._plant.world_frame()
        J = self._plant.CalcJacobianTranslationalVelocity(
            context, JacobianWrtVariable.kV, tip.body_frame(), np.zeros(3), world, world
        )
        return np.linalg.norm(J, axis=0)


def _for_drake(text: UrdfText, chain: Chain) -> str:
    """The same robot without shapes, and with all joints but the six fixed."""
    root = copy.deepcopy(text.root)
    for tag in _DROPPED:
        for element in root.findall(tag):
            root.remove(element)
    held = {joint.name for joint in chain.held}
    for tag, parts in _LEFT_OUT.items():
        for element in root.findall(tag):
            for part in (found for name in parts for found in element.findall(name)):
                element.remove(part)
            if tag == "joint" and element.get("name") in held:
                element.set("type", "fixed")
            limit = element.find("limit")
            if tag == "joint" and limit is not None and {"lower", "upper"} & set(limit.attrib):
                for end in ("lower", "upper"):  # zero is what is left out; Drake takes it for infinite
                    limit.set(end, limit.get(end, "0"))
    return ElementTree.tostring(root, encoding="unicode")


def _node(value: Any, label: str) -> Node:
    """Nodes of a tree, all in one place: what was read from a URDF has no lines of its own."""
    if isinstance(value, dict):
        return Node({key: _node(each, label) for key, each in value.items()}, label)
    if isinstance(value, list):
        return Node([_node(each, label) for each in value], label)
    return Node(value, label)

"""A robot as URDF, for simulators and planners that read nothing else."""

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable

import numpy as np
from pydrake.math import RigidTransform

from robots.description.model import Link, RobotModel
from robots.pose import zyx_from_rotation

_LARGEST_EFFORT = 1e6  # N m: robot files do not limit it, and URDF insists on a number


def urdf_text(robot: RobotModel) -> str:
    """The rigid robot: base, six revolute joints with limits, masses, and the tool as a link of its own.

    Names: links ``base``, ``link_1`` to ``link_6``, ``tool``; joints ``joint_1`` to ``joint_6``. Numbers have
    all their digits, so that the kinematics are those of the robot file. What URDF has no place for, the
    drive trains and a calibration's compliances, is left out.
    """
    root = ElementTree.Element("robot", name=robot.name)
    ElementTree.SubElement(root, "link", name="world")
    _add_link(root, "base", robot.base_link)
    _add_joint(root, "world_to_base", "fixed", "world", "base", robot.base.pose())
    parent = "base"
    for number, (joint, link) in enumerate(zip(robot.joints, robot.links, strict=True), 1):
        child = f"link_{number}"
        _add_link(root, child, link)
        element = _add_joint(root, f"joint_{number}", "revolute", parent, child, joint.placement.pose())
        ElementTree.SubElement(element, "axis", xyz=_numbers(joint.axis / np.linalg.norm(joint.axis)))
        limits = joint.limits
        ElementTree.SubElement(
            element,
            "limit",
            lower=repr(math.radians(limits.lower_deg)),
            upper=repr(math.radians(limits.upper_deg)),
            velocity=repr(math.radians(limits.speed_deg_s)),
            effort=repr(_LARGEST_EFFORT),
        )
        parent = child
    ElementTree.SubElement(root, "link", name="tool")
    _add_joint(root, "flange_to_tool", "fixed", parent, "tool", robot.tool.pose())
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _add_link(root: ElementTree.Element, name: str, link: Link) -> None:
    inertial = ElementTree.SubElement(ElementTree.SubElement(root, "link", name=name), "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_numbers(link.center_of_mass), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=repr(float(link.mass)))
    xx, yy, zz = (repr(float(moment)) for moment in link.inertia)
    ElementTree.SubElement(inertial, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")


def _add_joint(
    root: ElementTree.Element, name: str, kind: str, parent: str, child: str, X: RigidTransform
) -> ElementTree.Element:
    element = ElementTree.SubElement(root, "joint", name=name, type=kind)
    ElementTree.SubElement(element, "parent", link=parent)
    ElementTree.SubElement(element, "child", link=child)
    # URDF's roll, pitch and yaw are the ZYX Euler angles from back to front.
    angles = zyx_from_rotation(X.rotation().matrix())[::-1]
    ElementTree.SubElement(element, "origin", xyz=_numbers(X.translation()), rpy=_numbers(angles))
    return element


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)

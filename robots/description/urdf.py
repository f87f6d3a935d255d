"""Writing a robot as URDF, for simulators and planners."""

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from robots.description.drive_train import DriveTrain
from robots.description.model import Link, RobotModel
from robots.pose import zyx_from_rotation

_DRAKE = "http://drake.mit.edu"
_SHORTEST_PICTURE = 1e-3  # m, of a link that is drawn
_LARGEST_EFFORT = 1e6  # N m: robot files do not limit it, and URDF insists on a number


def urdf_text(robot: RobotModel, note: str = "") -> str:
    """The rigid robot: base, six revolute joints with limits, masses, and the tool as a link of its own.

    Names: links ``base``, ``link_1`` to ``link_6``, ``tool``; joints ``joint_1`` to ``joint_6``, each with a
    transmission, so that Drake makes actuators of them. Capsules picture the links. Numbers have all their
    digits, so that the kinematics are those of the robot file. What URDF has no place for, such as a
    calibration's compliances, is left out.

    Args:
        robot: what is written.
        note: what a comment says of it; what `not_in_urdf` says if it is empty.
    """
    root = ElementTree.Element("robot", {"name": robot.name, "xmlns:drake": _DRAKE})
    root.append(ElementTree.Comment(f" {note or not_in_urdf(robot)} "))
    ElementTree.SubElement(root, "link", name="world")
    _add_link(root, "base", robot.base_link)
    _add_joint(root, "world_to_base", "fixed", "world", "base", robot.base.pose())
    _picture(root, "base", robot.joints[0].placement.translation, robot.base_link.radius)
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
        following = robot.joints[number].placement if number < len(robot.joints) else robot.tool
        _picture(root, child, following.translation, link.radius)
        _add_transmission(root, number, joint.drive_train)
        parent = child
    ElementTree.SubElement(root, "link", name="tool")
    _add_joint(root, "flange_to_tool", "fixed", parent, "tool", robot.tool.pose())
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def not_in_urdf(robot: RobotModel) -> str:
    """What of a robot has no place in URDF, in a sentence."""
    lost = ["stiffness and friction of the drive trains"]
    if robot.counterbalance is not None:
        lost.append("the counterbalance")
    if any(link.beam is not None for link in robot.links):
        lost.append("links that bend")
    if robot.calibration.joint_errors:
        lost.append("errors of joints that depend on their angle")
    text = f"URDF cannot hold {', '.join(lost)}"
    if not robot.compliance.any():
        return text
    joints = ", ".join(str(number) for number, c in enumerate(robot.compliance, 1) if c)
    return (
        f"{text}, nor compliances of joints {joints}: here the robot does not yield under its weight and load"
    )


def _picture(root: ElementTree.Element, name: str, tip: np.ndarray, radius: float) -> None:
    """A cylinder from a link's origin to the next joint with a sphere at either end: a capsule."""
    length = float(np.linalg.norm(tip))
    if length < _SHORTEST_PICTURE:
        return
    link = root.find(f"link[@name='{name}']")
    assert link is not None
    R = RotationMatrix.MakeFromOneVector(np.asarray(tip) / length, 2)
    angles = zyx_from_rotation(R.matrix())[::-1]
    shapes = [
        (0.5 * np.asarray(tip), "cylinder", {"radius": repr(float(radius)), "length": repr(length)}),
        (np.zeros(3), "sphere", {"radius": repr(float(radius))}),
        (np.asarray(tip), "sphere", {"radius": repr(float(radius))}),
    ]
    for center, shape, sizes in shapes:
        visual = ElementTree.SubElement(link, "visual")
        ElementTree.SubElement(visual, "origin", xyz=_numbers(center), rpy=_numbers(angles))
        ElementTree.SubElement(ElementTree.SubElement(visual, "geometry"), shape, sizes)


def _add_transmission(root: ElementTree.Element, number: int, train: DriveTrain) -> None:
    transmission = ElementTree.SubElement(root, "transmission", name=f"transmission_{number}")
    ElementTree.SubElement(transmission, "type").text = "transmission_interface/SimpleTransmission"
    joint = ElementTree.SubElement(transmission, "joint", name=f"joint_{number}")
    interface = "hardware_interface/PositionJointInterface"
    ElementTree.SubElement(joint, "hardwareInterface").text = interface
    actuator = ElementTree.SubElement(transmission, "actuator", name=f"motor_{number}")
    ElementTree.SubElement(actuator, "hardwareInterface").text = interface
    # What others read as the reduction of the gear would make Drake's joint torques motor torques.
    ElementTree.SubElement(actuator, "drake:gear_ratio", value=repr(float(train.ratio)))
    ElementTree.SubElement(actuator, "drake:rotor_inertia", value=repr(float(train.rotor_inertia)))


def _add_link(root: ElementTree.Element, name: str, link: Link) -> None:
    inertial = ElementTree.SubElement(ElementTree.SubElement(root, "link", name=name), "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_numbers(link.center_of_mass), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=repr(float(link.mass)))
    xx, yy, zz = (repr(float(moment)) for moment in link.inertia)
    xy, xz, yz = (repr(float(product)) for product in link.products)
    ElementTree.SubElement(inertial, "inertia", ixx=xx, iyy=yy, izz=zz, ixy=xy, ixz=xz, iyz=yz)


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

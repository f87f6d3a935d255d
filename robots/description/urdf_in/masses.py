"""Masses of links whose URDF has none, from the mass of the whole robot.

URDFs made for planning, such as those of ROS-Industrial, have shapes and no inertia. A data sheet says what
the robot weighs, and robots of all sizes have it in much the same places: the shipped ones, of 32 to 1070 kg,
agree with the shares below within a half in the arm and a factor of three in the wrist.
"""

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping

import numpy as np
from pydrake.math import RotationMatrix

from robots.description.urdf_in.chain import UrdfText

SHARES = (0.300, 0.252, 0.245, 0.140, 0.042, 0.017, 0.004)  # of base and links 1 to 6
_MOMENTS = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}
_ROUNDING = 1e-6  # of the largest moment
_DENSITY = 2500.0  # kg/m^3, of housings with motors and gears inside


def assumed_masses(known: Mapping[int, float], total: float) -> dict[int, float]:
    """What the links weigh that do not say it, in kg, by their numbers; 0 is the base.

    Args:
        known: masses of those that say it, kg.
        total: of the whole robot, kg.

    Raises:
        ValueError: if those that say it weigh as much already, or all say it.
    """
    missing = [number for number in range(len(SHARES)) if number not in known]
    if not missing:
        raise ValueError("--mass is for links that have no mass, and here all have one")
    rest = total - sum(known.values())
    if rest <= 0.0:
        raise ValueError(
            f"--mass is that of the whole robot, got {total:g} kg; its links that say their masses have "
            f"{sum(known.values()):g} kg already"
        )
    of_rest = rest / sum(SHARES[number] for number in missing)
    return {number: of_rest * SHARES[number] for number in missing}


def refuse_impossible(text: UrdfText) -> None:
    """Refuses a link that no body can be: Drake would take one of its own in its place.

    Raises:
        ConfigurationError: if a mass is negative or not finite, or a principal moment of inertia is negative
            or larger than the sum of the two others; the message names the link.
    """
    for link in text.root.findall("link"):
        name, mass = link.get("name", ""), _number(link.find("inertial/mass"), "value")
        if not 0.0 <= mass < math.inf:
            raise text.refuse(f"link '{name}': its mass must be zero or positive, in kg, got {mass:g}", name)
        element = link.find("inertial/inertia")
        inertia = np.zeros((3, 3))
        for key, (i, j) in _MOMENTS.items():
            inertia[i, j] = inertia[j, i] = _number(element, key)
        moments = np.linalg.eigvalsh(inertia) if np.isfinite(inertia).all() else np.full(3, math.nan)
        least = -_ROUNDING * np.abs(moments).max()
        if mass > 0.0 and not (moments.min() >= least and moments.sum() - 2.0 * moments.max() >= least):
            raise text.refuse(
                f"link '{name}': its principal moments of inertia must not be negative, and none above the "
                f"sum of the others, got {', '.join(f'{each:g}' for each in moments)} kg m^2",
                name,
            )


def _number(element: ElementTree.Element | None, key: str) -> float:
    """A number of an element, zero where there is none; what is no number is left for Drake to say."""
    try:
        return float("0" if element is None else element.get(key, "0"))
    except ValueError:
        return 0.0


def add_inertia(text: UrdfText, link: str, mass: float, stretch: np.ndarray) -> None:
    """Makes a link a solid cylinder along its stretch, or a ball at its middle where it is shorter than that.

    Args:
        text: the URDF, which is changed.
        link: its name.
        mass: in kg.
        stretch: from its joint to the next one, or to the tool, in its frame, m, shape (3,).
    """
    length, ball = float(np.linalg.norm(stretch)), (0.75 * mass / (math.pi * _DENSITY)) ** (1.0 / 3.0)
    if length > 2.0 * ball:
        radius = math.sqrt(mass / (_DENSITY * math.pi * length))
        across = mass * (3.0 * radius**2 + length**2) / 12.0
        R = RotationMatrix.MakeFromOneVector(stretch, 2).matrix()
        inertia = R @ np.diag([across, across, 0.5 * mass * radius**2]) @ R.T
    else:
        inertia = 0.4 * mass * ball**2 * np.eye(3)
    element = text.root.find(f"link[@name='{link}']")
    assert element is not None
    for former in element.findall("inertial"):
        element.remove(former)
    inertial = ElementTree.SubElement(element, "inertial")
    xyz = " ".join(repr(float(each)) for each in 0.5 * np.asarray(stretch))
    ElementTree.SubElement(inertial, "origin", xyz=xyz, rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=repr(mass))
    moments = {name: repr(float(inertia[at])) for name, at in _MOMENTS.items()}
    ElementTree.SubElement(inertial, "inertia", moments)

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
_FLATTER = 0.25  # of it, by which it may be above the sum of the others: published files have up to 0.2
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


def correct_inertias(text: UrdfText) -> dict[str, str]:
    """Gives links that no body can be the nearest inertia that one can have.

    A principal moment above the sum of the two others, as many published files have one, means that the mass
    is less than flat: it is made flat, see `_flat`. Drake would take an inertia of its own in its place.

    Args:
        text: the URDF, which is changed.

    Returns:
        What was corrected, by the names of links.

    Raises:
        ConfigurationError: if a mass is negative or not finite, there is an inertia without one, or a
            principal moment of inertia is negative or larger by far than the sum of the two others; the
            message names the link.
    """
    corrected = {}
    for link in text.root.findall("link"):
        name, mass = link.get("name", ""), _number(link.find("inertial/mass"), "value")
        if not 0.0 <= mass < math.inf:
            raise text.refuse(f"link '{name}': its mass must be zero or positive, in kg, got {mass:g}", name)
        element = link.find("inertial/inertia")
        if element is None:
            continue
        inertia = np.zeros((3, 3))
        for key, (i, j) in _MOMENTS.items():
            inertia[i, j] = inertia[j, i] = _number(element, key)
        if not mass > 0.0:
            if inertia.any():
                raise text.refuse(
                    f"link '{name}': it has an inertia and no mass; give both, or neither where nothing is "
                    "known",
                    name,
                )
            continue
        finite = np.isfinite(inertia).all()
        moments, axes = np.linalg.eigh(inertia) if finite else (np.full(3, math.nan), np.eye(3))
        largest, excess = np.abs(moments).max(), 2.0 * moments.max() - moments.sum()
        if not (moments.min() >= -_ROUNDING * largest and excess <= _FLATTER * largest):
            raise text.refuse(
                f"link '{name}': its principal moments of inertia must not be negative, and none above the "
                f"sum of the others, got {_listed(moments)} kg m^2",
                name,
            )
        if excess > _ROUNDING * largest:
            flat = _flat(moments)
            _write_inertia(element, axes @ np.diag(flat) @ axes.T)
            corrected[name] = f"from {_listed(moments)} to {_listed(flat)} kg m^2"
    return corrected


def _flat(moments: np.ndarray) -> np.ndarray:
    """Of principal moments in rising order, the largest too large: those of the mass with no thickness.

    I = (yy + zz, xx + zz, xx + yy) with the second moments of mass xx, yy and zz. That along the third axis
    is negative: it is zero instead, and the largest moment stays.
    """
    return moments + 0.5 * (moments[2] - moments[0] - moments[1]) * np.array([1.0, 1.0, 0.0])


def _listed(moments: np.ndarray) -> str:
    return ", ".join(f"{each:.3g}" for each in moments)


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
    _write_inertia(ElementTree.SubElement(inertial, "inertia"), inertia)


def _write_inertia(element: ElementTree.Element, inertia: np.ndarray) -> None:
    for name, at in _MOMENTS.items():
        element.set(name, repr(float(inertia[at])))

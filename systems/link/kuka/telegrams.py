"""The XML telegrams of KUKA's Robot Sensor Interface (RSI) over Ethernet: written, and read without trust.

The controller sends `<Rob>` every cycle of 4 or 12 ms, with a time stamp IPOC in ms; a sensor answers before
the next one with `<Sen>`, a correction and the same IPOC. On the wire are degrees and millimetres, here rad
and m.
"""

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass

import numpy as np

from robots.description.model import NUM_JOINTS
from systems.link.session import TelegramError

AXES = tuple(f"A{number}" for number in range(1, NUM_JOINTS + 1))
CARTESIAN = ("X", "Y", "Z", "A", "B", "C")  # translation, then ZYX Euler angles
_LARGEST = 8192  # bytes of a telegram
_MOST_DIGITS = 18  # of an IPOC
_LARGEST_NUMBER = 1e6  # deg or mm; nothing in a cell is farther


class RsiError(TelegramError):
    """A datagram is no telegram, or a number cannot be sent."""


@dataclass(frozen=True)
class RobotTelegram:
    """What the controller says; angles in rad on its own axes, poses in m and rad."""

    ipoc: int  # ms
    measured: np.ndarray  # (6,) AIPos
    setpoint: np.ndarray  # (6,) ASPos, corrections among it
    pose: np.ndarray  # (6,) RIst: x, y, z in m and the ZYX Euler angles in rad
    late: int  # replies that did not come in time, as the controller counts them
    correction: np.ndarray | None = None  # (6,) rad, AxisCorrMon: the sum of what was corrected, where sent


@dataclass(frozen=True)
class SensorTelegram:
    """What a sensor answers; a correction of the axes, of the pose, or none."""

    ipoc: int
    axes: np.ndarray | None = None  # (6,) rad, AKorr
    pose: np.ndarray | None = None  # (6,) m and rad, RKorr


def read_robot(data: bytes) -> RobotTelegram:
    """Reads what a controller sends.

    Raises:
        RsiError: if it is none, or a part that is needed is missing or not a finite number.
    """
    root = _root(data, "Rob")
    delay = root.find("Delay")
    return RobotTelegram(
        ipoc=_ipoc(root),
        measured=_axes(root, "AIPos"),
        setpoint=_axes(root, "ASPos"),
        pose=_pose(root, "RIst"),
        late=0 if delay is None else round(_number(delay.get("D"), "Delay.D")),
        correction=None if root.find("AxisCorrMon") is None else _axes(root, "AxisCorrMon"),
    )


def read_sensor(data: bytes) -> SensorTelegram:
    """Reads what a sensor answers. Raises RsiError as `read_robot`."""
    root = _root(data, "Sen")
    return SensorTelegram(
        ipoc=_ipoc(root),
        axes=None if root.find("AKorr") is None else _axes(root, "AKorr"),
        pose=None if root.find("RKorr") is None else _pose(root, "RKorr"),
    )


def write_robot(telegram: RobotTelegram) -> bytes:
    """Writes what a controller sends."""
    pose = np.concatenate([1e3 * telegram.pose[:3], np.rad2deg(telegram.pose[3:])])
    parts = [
        _element("RIst", CARTESIAN, pose),
        _element("AIPos", AXES, np.rad2deg(telegram.measured)),
        _element("ASPos", AXES, np.rad2deg(telegram.setpoint)),
    ]
    if telegram.correction is not None:
        parts.append(_element("AxisCorrMon", AXES, np.rad2deg(telegram.correction)))
    parts.append(f'<Delay D="{telegram.late}" />')
    return f'<Rob Type="KUKA">{"".join(parts)}<IPOC>{telegram.ipoc}</IPOC></Rob>'.encode()


def write_sensor(telegram: SensorTelegram, name: str = "ImFree") -> bytes:
    """Writes what a sensor answers; ``name`` is the SENTYPE of the controller's configuration.

    Raises:
        RsiError: if a number is not finite.
    """
    parts = ""
    if telegram.pose is not None:
        pose = np.concatenate([1e3 * telegram.pose[:3], np.rad2deg(telegram.pose[3:])])
        parts += _element("RKorr", CARTESIAN, pose)
    if telegram.axes is not None:
        parts += _element("AKorr", AXES, np.rad2deg(telegram.axes))
    return f'<Sen Type="{name}">{parts}<IPOC>{telegram.ipoc}</IPOC></Sen>'.encode()


def _element(tag: str, names: tuple[str, ...], values: np.ndarray) -> str:
    if not np.isfinite(values).all():
        raise RsiError(f"RSI: {tag} is not finite")
    # Nine decimals of a degree are far below what a robot resolves, and relative steps do not add up to more.
    numbers = " ".join(f'{name}="{value:.9f}"' for name, value in zip(names, values.tolist(), strict=True))
    return f"<{tag} {numbers} />"


def _root(data: bytes, tag: str) -> ET.Element:
    # Telegrams have no document type; without one there are no entities that could be expanded.
    if len(data) > _LARGEST or b"<!" in data:
        raise RsiError("RSI: no telegram")
    try:
        root = ET.fromstring(data)
    except (ET.ParseError, ValueError, LookupError) as error:  # LookupError: an encoding that does not exist
        raise RsiError(f"RSI: no XML: {error}") from error
    if root.tag != tag:
        raise RsiError(f"RSI: expected <{tag}>, got <{root.tag}>")
    return root


def _ipoc(root: ET.Element) -> int:
    text = (root.findtext("IPOC") or "").strip()
    if not (text.isascii() and text.isdigit() and len(text) <= _MOST_DIGITS):
        raise RsiError("RSI: IPOC is no whole number")
    return int(text)


def _axes(root: ET.Element, tag: str) -> np.ndarray:
    return np.deg2rad(_attributes(root, tag, AXES))


def _pose(root: ET.Element, tag: str) -> np.ndarray:
    values = _attributes(root, tag, CARTESIAN)
    return np.concatenate([1e-3 * values[:3], np.deg2rad(values[3:])])


def _attributes(root: ET.Element, tag: str, names: tuple[str, ...]) -> np.ndarray:
    element = root.find(tag)
    if element is None:
        raise RsiError(f"RSI: {tag} is missing")
    return np.array([_number(element.get(name), f"{tag}.{name}") for name in names])


def _number(text: str | None, what: str) -> float:
    try:
        value = float(text or "")
    except ValueError as error:
        raise RsiError(f"RSI: {what} is no number") from error
    if not (math.isfinite(value) and abs(value) <= _LARGEST_NUMBER):
        raise RsiError(f"RSI: {what} is out of range")
    return value

"""Which links and joints of a URDF are the robot: six revolute joints in a row from a base to a tip.

The structure is read from the text, before Drake sees it: Drake would turn a loop, a mimic joint or a macro
that was not expanded into a failure that says little of the file.
"""

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from robots.configuration.nodes import ConfigurationError

NUM_AXES = 6
_REVOLUTE = ("revolute", "continuous")
_TOOL = "tool0"  # the frame on the flange in which ROS-Industrial has the tool


@dataclass(frozen=True)
class UrdfJoint:
    """A joint as the text has it."""

    name: str
    kind: str
    parent: str
    child: str
    mimics: str  # the joint that it follows, or nothing

    @property
    def moves(self) -> bool:
        """Whether it is not fixed."""
        return self.kind != "fixed"


@dataclass(frozen=True)
class Chain:
    """The robot in a URDF."""

    base: str  # link whose frame is the world
    joints: tuple[UrdfJoint, ...]  # the six, from the base on
    tip: str  # link whose frame is the tool
    held: tuple[UrdfJoint, ...]  # further joints that could move and are taken as fixed at zero


class UrdfText:
    """A URDF that has been read as XML and is a tree of links."""

    def __init__(self, path: Path, label: str) -> None:
        """Reads a file.

        Args:
            path: of the file.
            label: how messages call it.

        Raises:
            ConfigurationError: if it is no URDF, still has macros, or its links are no tree.
        """
        self.path, self.label = path, label
        try:
            self._lines = path.read_text(encoding="utf-8").splitlines()
            self.root = ElementTree.fromstring("\n".join(self._lines))
        except OSError as error:
            raise ConfigurationError(f"{label}: {(error.strerror or str(error)).lower()}") from error
        except (UnicodeDecodeError, ElementTree.ParseError) as error:
            raise ConfigurationError(f"{label}: no readable URDF: {' '.join(str(error).split())}") from error
        if self.root.tag != "robot":
            raise ConfigurationError(f"{label}: a URDF begins with <robot>, got <{self.root.tag}>")
        self._refuse_macros()
        self.links = [element.get("name", "") for element in self.root.findall("link")]
        self.joints = [self._joint(element) for element in self.root.findall("joint")]
        self._above: dict[str, UrdfJoint] = {}
        for joint in self.joints:
            self._hang(joint)
        if not self.links:
            raise ConfigurationError(f"{label}: it has no links")
        roots = [link for link in self.links if link not in self._above]
        if len(roots) != 1:
            found = "there is none: the links form a loop" if not roots else f"got {', '.join(roots)}"
            raise ConfigurationError(f"{label}: one link must carry all others, {found}")
        self.root_link = roots[0]

    def refuse(self, reason: str, name: str = "") -> ConfigurationError:
        """The error with the line on which a name is given, if there is one."""
        marks = (f'name="{name}"', f"name='{name}'")
        lines = [n for n, line in enumerate(self._lines, 1) if any(mark in line for mark in marks)]
        place = f"{self.label}, line {lines[0]}" if name and lines else self.label
        return ConfigurationError(f"{place}: {reason}")

    def chain(self, base: str = "", tip: str = "") -> Chain:
        """The robot between two links.

        Args:
            base: the link whose frame is the world; by default the one that carries all others.
            tip: the link whose frame is the tool; by default ``tool0`` if the last of the six joints moves
                it, else the only link that ends the arm, else the one that the last joint moves.

        Raises:
            ConfigurationError: if these are not six revolute joints in a row.
        """
        for option, link in (("--base-link", base), ("--tip-link", tip)):
            if link and link not in self.links:
                raise ConfigurationError(
                    f"{self.label}: {option} must be one of {', '.join(self.links)}, got '{link}'"
                )
        base = base or self.root_link
        joints = self._way(base, tip) if tip else self._trunk(base)
        self._check(joints)
        tip = tip or self._tip_behind(joints[-1])
        names = {joint.name for joint in joints}
        held = tuple(joint for joint in self.joints if joint.moves and joint.name not in names)
        return Chain(base, tuple(joints), tip, held)

    def _refuse_macros(self) -> None:
        for element in self.root.iter():
            values = (str(element.tag), *element.attrib.values())
            is_macro = "/xacro}" in values[0] or any(re.search(r"\$[({]", value) for value in values[1:])
            if is_macro:
                raise ConfigurationError(
                    f"{self.label}: it still has xacro macros; expand them first: xacro in.xacro > out.urdf"
                )

    def _joint(self, element: ElementTree.Element) -> UrdfJoint:
        name = element.get("name", "")

        def end(side: str) -> str:
            found = element.find(side)
            link = "" if found is None else found.get("link", "")
            if link not in self.links:
                raise self.refuse(f"joint '{name}': its {side} '{link}' is no link of this file", name)
            return link

        self._check_limits(name, element.find("limit"))
        mimic = element.find("mimic")
        follows = "" if mimic is None else mimic.get("joint", "?")
        return UrdfJoint(name, element.get("type", ""), end("parent"), end("child"), follows)

    def _check_limits(self, name: str, limit: ElementTree.Element | None) -> None:
        """Drake ends the process where limits are crossed."""
        try:
            lower, upper = (
                float(limit.get(side, "0")) if limit is not None else 0.0 for side in ("lower", "upper")
            )
        except ValueError as error:
            raise self.refuse(f"joint '{name}': a limit is no number: {error}", name) from error
        if not lower <= upper:
            raise self.refuse(f"joint '{name}': lower limit {lower:g} is not below the upper {upper:g}", name)

    def _hang(self, joint: UrdfJoint) -> None:
        other = self._above.setdefault(joint.child, joint)
        if other is not joint:
            raise self.refuse(
                f"link '{joint.child}' hangs on two joints, '{other.name}' and '{joint.name}': a loop; "
                "only open chains can be read",
                joint.name,
            )

    def _way(self, base: str, tip: str) -> list[UrdfJoint]:
        """The joints that move between two links, from the base on."""
        way, link = [], tip
        while link != base:
            if link not in self._above:
                raise self.refuse(f"link '{tip}' is not carried by link '{base}'", tip)
            way.append(self._above[link])
            link = self._above[link].parent
        return [joint for joint in reversed(way) if joint.moves]

    def _behind(self, link: str) -> tuple[list[UrdfJoint], list[str]]:
        """The joints that move next behind a link, and the links that are fixed to it, itself first."""
        moving, fixed = [], [link]
        for each in fixed:
            for joint in (joint for joint in self.joints if joint.parent == each):
                if joint.moves:
                    moving.append(joint)
                else:
                    fixed.append(joint.child)
        return moving, fixed

    def _trunk(self, base: str) -> list[UrdfJoint]:
        """The joints that move one behind the other, until the arm ends or divides into several."""
        joints, link = [], base
        while True:
            moving, _ = self._behind(link)
            if len(moving) != 1 or (len(joints) == NUM_AXES and not _is_axis(moving[0])):
                break
            joints.append(moving[0])
            link = moving[0].child
        if len(joints) < NUM_AXES and len(moving) > 1:
            names = ", ".join(f"'{joint.name}'" for joint in moving)
            raise self.refuse(
                f"behind '{link}' the arm divides into {names}; choose an end with --tip-link LINK", link
            )
        return joints

    def _check(self, joints: Iterable[UrdfJoint]) -> None:
        joints = list(joints)
        for joint in joints:
            if joint.kind not in _REVOLUTE:
                raise self.refuse(
                    f"joint '{joint.name}' is {joint.kind}; only robots with six revolute joints in a row "
                    "can be read",
                    joint.name,
                )
            if joint.mimics:
                raise self.refuse(
                    f"joint '{joint.name}' mimics '{joint.mimics}'; coupled joints cannot be read", joint.name
                )
        if len(joints) != NUM_AXES:
            names = ", ".join(joint.name for joint in joints) or "none"
            raise ConfigurationError(
                f"{self.label}: needs six revolute joints in a row, got {len(joints)}: {names}; a part of "
                "them is chosen with truetip robots import --base-link LINK --tip-link LINK"
            )

    def _tip_behind(self, joint: UrdfJoint) -> str:
        _, fixed = self._behind(joint.child)
        if _TOOL in fixed:
            return _TOOL
        ends = [link for link in fixed if not any(other.parent == link for other in self.joints)]
        return ends[0] if len(ends) == 1 else joint.child


def _is_axis(joint: UrdfJoint) -> bool:
    """Whether a joint may be an axis of an arm, rather than a finger of a gripper."""
    return joint.kind in _REVOLUTE and not joint.mimics

"""What sources in a robot file say against its numbers: those of another robot, or springs all assumed."""

import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from robots.description.model import RobotModel, shipped_robots
from robots.description.urdf_in.assumed import SOURCE

_ASSUMED = "assumed"


def foreign_sources(robot: RobotModel) -> dict[str, int]:
    """Shipped robots of another name whose ``source`` texts stand in a robot, and how many.

    Texts that two of them share, and assumptions, say nothing of where a file is from.
    """
    found: dict[str, int] = {}
    for text in _sources(robot):
        if not text or text.startswith(_ASSUMED):
            continue
        quoted = [f"source: {mark}{text}" for mark in ("", '"', "'", "|- ")]
        holders = {name for name, file in _shipped_files() if any(each in file for each in quoted)}
        if len(holders) == 1 and robot.name not in holders:
            (name,) = holders
            found[name] = found.get(name, 0) + 1
    return found


def foreign_sources_note(robot: RobotModel) -> str:
    """The same in a sentence; empty if there are none, or if the robot is a shipped one.

    It may be calibrated or identified: ``KUKA KR 16-2, calibrated`` is the KUKA KR 16-2.
    """
    if any(robot.name == name or robot.name.startswith(f"{name}, ") for name, _ in _shipped_files()):
        return ""
    found = foreign_sources(robot)
    if not found:
        return ""
    parts = ", ".join(f"{count} of {name}" for name, count in found.items())
    return f"sources in the file of {robot.name} are those of another robot: {parts}; are its numbers, too?"


def assumed_note(robot: RobotModel) -> str:
    """What the import of a URDF has assumed of a robot, and where real numbers belong, in a sentence.

    Empty where the springs of one joint at least are from elsewhere: somebody has looked after them then.
    """
    if any(joint.drive_train.source != SOURCE for joint in robot.joints):
        return ""
    has_bearings = all(joint.tilting is not None and joint.tilting.source == SOURCE for joint in robot.joints)
    parts = "gear springs, motors, friction" + (" and bearings" if has_bearings else "")
    return (
        f"{parts} of {robot.name} are assumed from the inertia that each joint moves, and millimetres that "
        "are simulated rest on them; real ones belong in drive_train and tilting of its robot file (of a "
        "URDF: truetip robots import --write), truetip identify finds them"
    )


@cache
def _shipped_files() -> tuple[tuple[str, str], ...]:
    """Names and texts of the robot files that come with the package; the texts in one line."""
    texts = [(files("robots") / "data" / f"{name}.yaml").read_text("utf-8") for name in shipped_robots()]
    names = [re.search(r"^name: *(.*?) *$", text, re.MULTILINE) for text in texts]
    return tuple(
        (name[1].strip("'\""), " ".join(text.split()))
        for name, text in zip(names, texts, strict=True)
        if name is not None
    )


def _sources(part: Any) -> Iterator[str]:
    """Every text whose field is a source, in a tree of dataclasses, in one line."""
    if isinstance(part, list):
        for each in part:
            yield from _sources(each)
    elif is_dataclass(part):
        for entry in fields(part):
            value = getattr(part, entry.name)
            if entry.name.endswith("source") and isinstance(value, str):
                yield " ".join(value.split())
            else:
                yield from _sources(value)

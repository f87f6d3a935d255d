"""The fields of scenario and robot files as pages: default, range and unit, and what each means."""

from typing import Any

from diagrams.scenario.scenario import Scenario, load_scenario, shipped_scenarios
from experiments.manual.markdown import table
from robots.configuration.described import Described, described
from robots.description.model import RobotModel, load_robot, shipped_robots

_HEAD = ("field", "default", "allowed", "meaning")
_GROUPS_OF_SCENARIO = 2  # station.camera has a chapter of its own
_GROUPS_OF_ROBOT = 1


def scenario_page() -> str:
    """Every field of a scenario file."""
    text = (
        "# Fields of a scenario\n\nA scenario file says what is different from the file that it `extends`; "
        "what nobody says has its default. A field of a kind with a tag is written "
        "`station.camera(!PoseCamera).delay`: it stands below `camera: !PoseCamera`. Entries of a list are "
        "written `events[]`. On the command line `--set station.camera.delay=0.008` sets one field. Units "
        "are SI where the name of a field says no other.\n\n"
    )
    return text + _chapters(Scenario(), _GROUPS_OF_SCENARIO)


def robot_page() -> str:
    """Every field of a robot file."""
    text = (
        "# Fields of a robot\n\nA robot file describes six joints and six links, or `extends` another robot. "
        "Every part carries a `source`: where its numbers come from, or the word `assumed`. Units are SI "
        "where the name of a field says no other.\n\n"
    )
    return text + _chapters(RobotModel(), _GROUPS_OF_ROBOT)


def shipped_page() -> str:
    """What comes with truetip: scenarios and robots."""
    scenarios = [(f"`{name}`", load_scenario(name).description) for name in shipped_scenarios()]
    robots = [(f"`{name}`", load_robot(name).name) for name in shipped_robots()]
    return (
        "# Shipped scenarios and robots\n\n## Scenarios\n\n`truetip scenarios --show NAME` prints one with "
        "all its values.\n\n"
        + table(("scenario", "what it is"), scenarios)
        + "\n## Robots\n\n"
        + table(("robot", "what it is"), robots)
    )


def _chapters(example: Any, depth: int) -> str:
    """Tables of the fields, one for each group down to a depth."""
    chapters: dict[str, list[Described]] = {}
    for row in described(example):
        chapters.setdefault(_group(row.path, depth), []).append(row)
    parts = []
    for name, inside in chapters.items():
        title = f"`{name}`" if name else "The file itself"
        parts.append(f"## {title}\n\n" + table(_HEAD, [_row(each) for each in inside]))
    return "\n".join(parts)


def _group(path: str, depth: int) -> str:
    """The group in whose chapter a field stands: of ``station.camera(!PoseCamera).delay`` station.camera."""
    head, tag, _ = path.partition("(")
    parts = head.split(".")
    return ".".join((parts if tag else parts[:-1])[:depth])


def _row(field: Described) -> tuple[str, str, str, str]:
    default = f"`{field.default}`" if field.default else ""
    return f"`{field.path}`", default, field.allowed, field.meaning

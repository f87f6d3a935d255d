"""``truetip robots``: lists those that come with it, and makes a robot file of a URDF."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape

from experiments.cli.command_app import command_app
from experiments.cli.console import print_list, print_note, refusing
from experiments.cli.option_limits import at_most
from experiments.cli.staging import YAML, staged_file
from experiments.report.files import write_text
from robots.configuration.nodes import ConfigurationError
from robots.description.model import RobotModel, load_robot, robot_of, shipped_robots
from robots.description.robot_file import robot_text
from robots.description.urdf_in.reader import UrdfRobot, is_urdf, read_urdf

_HEAVIEST = 2.0e4  # kg: the heaviest industrial robots weigh some 12 t; more is a mass in grams
_WIDE = 1800.0  # deg to a side: no joint but an endless one turns so far

robots_app = command_app(
    "List the robots that come with truetip, or make a robot file of a URDF.", no_args_is_help=False
)


@robots_app.callback(invoke_without_command=True)
def robots_command(context: typer.Context) -> None:
    """List the robots that come with truetip, or make a robot file of a URDF."""
    if context.invoked_subcommand is None:
        print_list((name, load_robot(name).name) for name in shipped_robots())


@robots_app.command("import")
def import_command(
    urdf: Annotated[str, typer.Argument(metavar="FILE.urdf", help="A URDF, macros expanded.")],
    base: Annotated[
        str,
        typer.Option(
            "--base-link",
            metavar="LINK",
            help="Its frame is the world.",
            show_default="the one that carries all",
        ),
    ] = "",
    tip: Annotated[
        str,
        typer.Option(
            "--tip-link", metavar="LINK", help="Its frame is the tool.", show_default="tool0, or the end"
        ),
    ] = "",
    package: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=DIR",
            help="Where the meshes of a package are; repeatable. Others are looked for above the file.",
        ),
    ] = None,
    mass: Annotated[
        float | None,
        typer.Option(
            metavar="KG",
            help="Of the whole robot, from its data sheet, where links do not say theirs or all the same.",
        ),
    ] = None,
    payload: Annotated[
        float | None,
        typer.Option(
            metavar="KG",
            help="The largest that it carries.",
            show_default="a seventh of the mass that moves",
        ),
    ] = None,
    write: Annotated[str | None, typer.Option(metavar="FILE.yaml", help="The robot file to write.")] = None,
) -> None:
    """Make a robot file of a URDF, and say what is assumed in it."""
    console = Console()
    with refusing(ValueError, OSError), ExitStack() as stack:
        at_most("--mass", _HEAVIEST, "kg", mass)
        at_most("--payload", _HEAVIEST, "kg", payload)
        target = stack.enter_context(staged_file(write, *YAML)) if write else None
        if not is_urdf(urdf):
            raise ConfigurationError(f"'{urdf}' is no URDF: its name must end in .urdf or .xacro")
        folders = _folders(package or [])
        found = read_urdf(Path(urdf), f"URDF {urdf}", base, tip, folders, mass=mass, payload=payload)
        robot = robot_of(found.nodes)
        if write and target:
            write_text(target, robot_text(robot, beside=Path(write)))
    _describe(console, robot, found)
    if write:
        console.print(escape(write), soft_wrap=True)


def _folders(options: list[str]) -> dict[str, Path]:
    folders = {}
    for option in options:
        name, separator, folder = option.partition("=")
        if not separator or not name or not Path(folder).is_dir():
            raise ConfigurationError(f"--package must be NAME=DIR with a folder that exists, got '{option}'")
        folders[name] = Path(folder)
    return folders


def _describe(console: Console, robot: RobotModel, found: UrdfRobot) -> None:
    limits = np.rad2deg(np.stack([robot.lower, robot.upper], -1))
    rows = [("robot", robot.name), ("world and tool", f"{found.chain.base}, {found.chain.tip}")]
    rows += [
        (f"joint {number}", f"{joint.name}: {lower:.0f} to {upper:.0f} deg, its link {link.mass:.3g} kg")
        for number, (joint, (lower, upper), link) in enumerate(
            zip(found.chain.joints, limits, robot.links, strict=True), 1
        )
    ]
    rows.append(("pictures", str(sum(len(link.pictures) for link in [robot.base_link, *robot.links]))))
    rows.append(("assumed", ", ".join(found.assumed)))
    print_list(rows)
    wide = [
        joint.name
        for joint, ends in zip(found.chain.joints, limits, strict=True)
        if np.abs(ends).max() > _WIDE
    ]
    if wide:
        print_note(
            console,
            f"joints with {_WIDE:g} degrees and more to a side: {', '.join(wide)}; limits of a URDF are in "
            "radians, are these in degrees?",
        )
    if found.chain.held:
        names = ", ".join(joint.name for joint in found.chain.held)
        print_note(console, f"these joints are taken as fixed at zero: {names}")
    if found.placeholder is not None:
        print_note(
            console,
            f"all links weigh {found.placeholder:g} kg and have the same inertia, which looks like a "
            "placeholder; with the robot's mass from its data sheet, --mass KG, masses are assumed instead",
        )
    for name, change in found.corrected.items():
        print_note(
            console,
            f"no body can have the moments of inertia of link '{name}', one is above the sum of the others; "
            f"the nearest that a body can have are taken, {change}",
        )
    if found.missing_meshes:
        print_note(
            console,
            f"{len(found.missing_meshes)} meshes were not found, for example {found.missing_meshes[0]}; "
            "name their folder with --package NAME=DIR",
        )
    if found.unreadable_meshes:
        print_note(
            console,
            f"{len(found.unreadable_meshes)} meshes are left out, for example: {found.unreadable_meshes[0]}; "
            "shapes for collision stand in for them where there are any",
        )

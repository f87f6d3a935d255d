"""``truetip design``: optimal measurement configurations."""

import re
import resource
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.markup import escape

from experiments.calibration.design_program import ProgramFiles
from experiments.cli.console import count as counted
from experiments.cli.console import print_files, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least, one_of, without_effect
from experiments.cli.options import JsonOption, PictureOption
from experiments.cli.prepare import noted_robot
from experiments.cli.staging import PAGE, TABLE, staged_file
from experiments.report.files import write_text
from experiments.report.plot_page import Section, write_plot_page
from experiments.report.robot_plot import joints_figure, tips_figure
from robots.calibration.reduction import shown_by_errors
from robots.description.model import RobotModel
from robots.measurement_design.candidate_grid import AxisRange, own_ranges
from robots.measurement_design.clear_ways import ClearWays
from robots.measurement_design.constraints import AdmissibleConfig, AdmissibleConfigurations, View
from robots.measurement_design.criteria import NAMES
from robots.measurement_design.design import MeasurementDesign, design_measurements
from robots.measurement_design.obstacles import read_obstacles

_ROUNDING = 1e-6  # deg
_FARTHEST = 100.0  # m, of a camera or a corner: whoever writes more has written mm
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)"
_MEASURES = {
    "b3": "smallest eigenvalue of the information matrix, in m and rad",
    "d": "root of its determinant: volume of the confidence ellipsoid of the parameters",
    "i": "inverse of the mean variance of the pose over the workspace",
}


def design_command(
    robot: Annotated[
        str, typer.Option("--robot", metavar="NAME|FILE", help="The robot that will be measured.")
    ] = "irb1200",
    count: Annotated[int, typer.Option(metavar="N", help="Configurations.")] = 75,
    criterion: Annotated[str, typer.Option(metavar="NAME", help=f"One of {', '.join(NAMES)}.")] = "b3",
    position_only: Annotated[
        bool, typer.Option("--position-only", help="Design for measurements of the tool position only.")
    ] = False,
    anywhere: Annotated[
        bool, typer.Option("--anywhere", help="Ignore the floor and the arm itself.")
    ] = False,
    camera: Annotated[
        str | None,
        typer.Option(
            "--camera-at",
            metavar="X,Y,Z",
            help="Position of a camera in m that must see the tool; by default cameras are all around.",
        ),
    ] = None,
    joint_range: Annotated[
        list[str] | None,
        typer.Option(
            "--range",
            metavar="J=LOW:HIGH",
            help="Range of joint J in degrees, for example 2=-45:90; repeatable. Others keep their own.",
        ),
    ] = None,
    box: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z,X,Y,Z", help="Two corners in m of the volume in which the tool stays."),
    ] = None,
    obstacles: Annotated[
        str | None, typer.Option(metavar="FILE.yaml", help="Boxes that the arm keeps clear of.")
    ] = None,
    complete: Annotated[
        bool,
        typer.Option(
            "--complete",
            help="For the complete error model even where the parameters of Probst (2024) suffice.",
        ),
    ] = False,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of the search.")] = 0,
    out: Annotated[
        str | None,
        typer.Option("--write", metavar="FILE.csv", help="The configurations, in the order of the visits."),
    ] = None,
    program: Annotated[
        str | None,
        typer.Option(
            metavar="rapid|krl",
            help="Also write the run as a robot program, with moves, settling and trigger, and the table "
            "that it will fill; beside --write.",
        ),
    ] = None,
    settle: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds before the trigger.", show_default="0.5")
    ] = None,
    trigger: Annotated[
        str, typer.Option(metavar="NAME|N", help="Digital output.", show_default="doTrigger, or 1 in KRL")
    ] = "",
    report: PictureOption = Path("out/design.html"),
    json_file: JsonOption = None,
) -> None:
    """Choose the measurement configurations that determine the robot's errors best."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        one_of("--criterion", NAMES, criterion)
        at_least("--seed", 0, seed)
        if anywhere:
            for option, given in (("--camera-at", camera), ("--box", box), ("--obstacles", obstacles)):
                without_effect(option, given, "--anywhere")
        run = ProgramFiles(program, out, settle, trigger)
        page = stack.enter_context(staged_file(report, *PAGE))
        run_stage = run.staged(stack)
        table = stack.enter_context(staged_file(out, *TABLE)) if out else None
        stack.enter_context(output.staged())
        model = noted_robot(human, robot)
        before, started = _peak_mb(), time.perf_counter()
        view = None if camera is None else View(_place(camera))
        config = AdmissibleConfig(
            view=view, box=_box(box), obstacles=read_obstacles(obstacles) if obstacles else ()
        )
        admissible = None if anywhere else AdmissibleConfigurations(model, config)
        ranges = _ranges(model, joint_range or [])
        with progress_bar(f"{count} configurations") as progress:
            design = design_measurements(
                model,
                count,
                criterion,
                position_only,
                ranges,
                admissible,
                seed,
                progress,
                is_complete=complete or None,
            )
        seconds, further = time.perf_counter() - started, shown_by_errors(model, position_only)
        result = {
            "criterion": criterion,
            "count": count,
            "parameters": design.num_parameters,
            "shown_by_errors": further,
            "complete": design.is_complete,
            "b3": design.b3,
            "bound": design.bound,
            "value": design.value,
            "seconds": seconds,
            "peak_mb": _peak_mb() - before,
        }
        if table:
            write_text(table, configuration_text(design))
        vias: list[np.ndarray] = []
        if program and not anywhere:
            free = AdmissibleConfig(obstacles=config.obstacles)
            vias = _ways(model, free, design.configurations)
            result["ways_with_via_points"] = sum(len(via) > 0 for via in vias)
        written = run.write(run_stage, design.configurations, position_only, vias)
        output.write(result)
        write_design_page(page, model, design)
    human.print(escape(design_verdict(design) + _further(further)))
    human.print(f"{seconds:.1f} s, {result['peak_mb']:.0f} MB beside the program itself")
    print_files(human, report, out, *written)


def _ways(robot: RobotModel, config: AdmissibleConfig, q: np.ndarray) -> list[np.ndarray]:
    """The via points to each configuration (n, 6) in rad, from all joints at zero if the robot can be there.

    Raises:
        ValueError: if there is no way to one.
    """
    check = AdmissibleConfigurations(robot, config)
    start = np.zeros((1, q.shape[1]))
    ways = ClearWays(robot, check, config.clearance)
    if check(start).all():
        return ways.through(np.vstack([start, q]))
    return [np.zeros_like(start[:0]), *ways.through(q)]


def _place(text: str) -> tuple[float, float, float]:
    x, y, z = _numbers("--camera-at", text, "three", "1.5,0,1.2")
    return x, y, z


def _box(text: str | None) -> tuple[np.ndarray, np.ndarray] | None:
    if text is None:
        return None
    corners = np.array(_numbers("--box", text, "six", "0.2,-0.5,0,0.8,0.5,0.9")).reshape(2, 3)
    return corners[0], corners[1]


def _numbers(option: str, text: str, count: str, example: str) -> list[float]:
    """Coordinates in m, as many as in an example. Raises ValueError that names the option."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != len(example.split(",")) or not (np.abs(values) <= _FARTHEST).all():
        raise ValueError(
            f"{option} must be {count} numbers in m such as {example}, up to {_FARTHEST:g} m, got '{text}'"
        )
    return values


def _ranges(robot: RobotModel, texts: list[str]) -> tuple[AxisRange, ...]:
    """The robot's own ranges with those of ``--range`` in their places."""
    ranges, done = list(own_ranges(robot)), set()
    for text in texts:
        found = re.fullmatch(rf"([1-6])=({_NUMBER}):({_NUMBER})", text.strip())
        if not found:
            raise ValueError(f"--range must be like 2=-45:90 with a joint from 1 to 6, got '{text}'")
        joint = int(found[1]) - 1
        if joint in done:
            raise ValueError(f"--range of joint {joint + 1} is given twice, got '{text}', too")
        done.add(joint)
        low, high = float(found[2]), float(found[3])
        if not low < high:
            raise ValueError(
                f"--range of joint {joint + 1}: its first end must be below the second, got '{text}'"
            )
        limits = np.rad2deg([robot.lower[joint], robot.upper[joint]])
        if not (limits[0] - _ROUNDING <= low and high <= limits[1] + _ROUNDING):
            raise ValueError(
                f"--range of joint {joint + 1} must be within {limits[0]:g} to {limits[1]:g} deg, "
                f"got '{text}'"
            )
        ranges[joint] = AxisRange(low, high)
    return tuple(ranges)


def design_verdict(design: MeasurementDesign) -> str:
    """What was reached, in a few sentences."""
    model = "the complete error model" if design.is_complete else "Probst (2024)"
    name = design.criterion.upper()
    restricted = (
        f", {design.num_refused} of those that came into question refused" if design.num_refused else ""
    )
    text = (
        f"{len(design.configurations)} configurations with {name} = {design.value:.5g}; no choice from the "
        f"{design.num_candidates} candidates of the grid{restricted} has more than {design.bound:.5g}, so "
        f"this one is at least {100.0 * design.value / design.bound:.2f} % of the best. It determines "
        f"{design.num_parameters} parameters of {model}."
    )
    return text if design.criterion == "b3" else f"{text} B3 = {design.b3:.4g}."


def _further(names: Sequence[str]) -> str:
    if not names:
        return ""
    return (
        f" These show on the robot as drawn; on one whose errors move its tool off its axis "
        f"{counted(len(names), 'parameter')} more will: {', '.join(names)}."
    )


def configuration_text(design: MeasurementDesign) -> str:
    """The configurations as a table, in the order of the visits."""
    header = ",".join(f"q{number}_rad" for number in range(1, 7))
    lines = [",".join(map(repr, row)) for row in design.configurations.tolist()]
    return "\n".join([header, *lines]) + "\n"


def write_design_page(path: Path, robot: RobotModel, design: MeasurementDesign) -> None:
    """The picture of a design as a page that opens offline."""
    sections = [
        Section(
            "Where the tool is measured",
            "Colour and line show the order of the visits; the robot stands at zero.",
            tips_figure(robot, design.configurations),
            620,
        ),
        Section(
            "Positions of the joints",
            f"The criterion {design.criterion.upper()}: {_MEASURES[design.criterion]}. "
            "Bars are the ranges of the joints.",
            joints_figure(design.configurations, robot.lower, robot.upper),
            380,
        ),
    ]
    write_plot_page(path, f"Measurement design, {robot.name}", design_verdict(design), sections)


def _peak_mb() -> float:
    """The most memory that this process has had; before the work it is the code, most of it Drake's."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024.0 if sys.platform != "darwin" else 1e6)

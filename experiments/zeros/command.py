"""``truetip zeros``: where the exact inverse of an elastic robot is unstable."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.markup import escape

from experiments.cli.console import count, print_files, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import refuse_given
from experiments.cli.options import (
    GridOption,
    JsonOption,
    PayloadOption,
    PictureOption,
    StudiedRobotOption,
)
from experiments.cli.prepare import noted_robot
from experiments.cli.staging import PAGE, staged_file
from experiments.report.plot_page import Section, write_plot_page
from experiments.zeros.body import body_zeros
from experiments.zeros.examples import EXAMPLES, example_named
from experiments.zeros.plots import plane_figure, workspace_figure, zeros_note
from experiments.zeros.study import ZeroStudy, study_zeros, zeros_json


def zeros_command(
    context: typer.Context,
    robot: StudiedRobotOption = "kr210",
    payload: PayloadOption = None,
    elasticity: Annotated[
        str, typer.Option(metavar="NAME", help="structure, or joints for elastic gears alone.")
    ] = "structure",
    grid: GridOption = 15,
    wrist: Annotated[
        str | None,
        typer.Option(
            metavar="Q4,Q5,Q6", help="Axes 4, 5 and 6 in degrees.", show_default="0,40.1,0: 0.7 rad"
        ),
    ] = None,
    example: Annotated[
        str | None, typer.Option(metavar="NAME", help=f"In place of a robot: {', '.join(EXAMPLES)}.")
    ] = None,
    body: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="In place of a robot: a flexible body on a joint, as standard input data."
        ),
    ] = None,
    out: PictureOption = Path("out/zeros.html"),
    json_file: JsonOption = None,
) -> None:
    """Find out whether an elastic robot has a stable exact inverse, and how fast its unstable zeros are."""
    human = human_console(json_file)
    with (
        json_output(json_file) as output,
        refusing(ValueError, OSError),
        staged_file(out, *PAGE) as page,
        output.staged(),
    ):
        if body is not None and example is not None:
            raise ValueError("--body and --example are two different things: give one of them")
        if body is not None:
            refuse_given(context, ("robot", "elasticity", "grid", "wrist"), "with --body")
        if example is not None:
            refuse_given(context, ("robot", "payload", "elasticity", "grid", "wrist"), "with --example")
        if body is not None or example is not None:
            found = body_zeros(body, payload or 0.0) if body else example_named(str(example))
            numbers, verdict = found.numbers, found.verdict
            name = body.name if body else f"example {example!s}".replace("_", " ")
            write_plot_page(page, f"Zeros, {name}", verdict, found.sections)
        else:
            model = noted_robot(human, robot)
            mass = model.payload.largest_mass if payload is None else payload
            with progress_bar(f"{grid * grid} positions") as progress:
                study = study_zeros(model, elasticity, mass, grid, progress, _wrist(wrist))
            numbers = zeros_json(study)
            verdict = zeros_verdict(study)
            _write_study(page, study, verdict)
        output.write(numbers)
    human.print(escape(verdict))
    print_files(human, out)


def _wrist(angles: str | None) -> np.ndarray | None:
    """Axes 4 to 6 in rad as an option says them, None for the usual ones. Raises ValueError."""
    if angles is None:
        return None
    try:
        wrist = np.deg2rad([float(part) for part in angles.split(",")])
    except ValueError:
        wrist = np.zeros(0)
    if wrist.shape != (3,) or not np.isfinite(wrist).all():
        raise ValueError(f"--wrist must be three angles in degrees such as 0,40,0, got '{angles}'")
    return wrist


def zeros_verdict(study: ZeroStudy) -> str:
    """What the zeros mean for a feedforward, in a sentence or two."""
    slowest = study.slowest_rhp
    unstable, poses = int(np.isfinite(slowest).sum()), len(study.regular)
    name = f"{study.robot.name}, {study.payload:g} kg, elastic {study.elasticity}"
    singular = slowest.size - poses
    left_out = f" Left out: {count(singular, 'position')} where the arm is singular." if singular else ""
    if not unstable:
        return f"{name}: no unstable zero in any of {poses} positions; the exact inverse is stable.{left_out}"
    return (
        f"{name}: zeros in the right half-plane in {unstable} of {poses} positions, so no causal inverse can "
        f"be exact there; the real part of the slowest is {np.nanmin(slowest):.0f} 1/s at the worst "
        f"position and {np.nanmedian(slowest):.0f} 1/s in the median.{left_out}"
    )


def _white(study: ZeroStudy) -> str:
    """What positions without a colour are; nothing if all have one."""
    empty = int(np.isnan(study.slowest_rhp).sum())
    singular = study.slowest_rhp.size - len(study.regular)
    reasons = ["no such zero"] * (empty > singular) + ["the arm is singular"] * (singular > 0)
    return f" White: {' or '.join(reasons)}." if reasons else ""


def _write_study(page: Path, study: ZeroStudy, verdict: str) -> None:
    sections = []
    wrist = ", ".join(f"{angle:.0f}" for angle in np.rad2deg(study.wrist) + 0.0)
    pose = f"axis 1 at zero, axes 4, 5 and 6 at {wrist} degrees"
    if np.isfinite(study.slowest_rhp).any():
        note = (
            f"From the motors to the pose of the tool; {pose}. A pair that has just crossed the imaginary "
            f"axis has a small real part at a high frequency.{_white(study)}"
        )
        sections.append(Section("Slowest zero in the right half-plane", note, workspace_figure(study), 560))
    middle = study.regular[len(study.regular) // 2]
    sections.append(
        Section(
            "Zeros of the middle position",
            f"With {pose}. {zeros_note(middle)}",
            plane_figure(middle),
        )
    )
    write_plot_page(page, f"Zeros, {study.robot.name}", verdict, sections)

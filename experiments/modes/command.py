"""``truetip modes``: natural frequencies of an elastic robot over its workspace, as numbers and pictures."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich import box
from rich.markup import escape
from rich.table import Table

from experiments.cli.console import print_files, print_table, progress_bar, refusing, wait_for_interrupt
from experiments.cli.json_output import human_console, json_output
from experiments.cli.options import (
    GridOption,
    JsonOption,
    PayloadOption,
    PictureOption,
    StudiedRobotOption,
)
from experiments.cli.prepare import noted_robot, with_assumed
from experiments.cli.staging import PAGE, staged_file
from experiments.modes.study import SHOWN_MODES, ModalStudy, modes_json, spread, study_modes
from experiments.modes.view import frequency_figure, show_mode, write_animation
from experiments.report.plot_page import Section, html_table, write_plot_page

STRETCHED_HEAD = ("mode", "Hz", "damp. %", "tip", "yielding joints")
WORKSPACE_HEAD = ("mode", "Hz", "median", "damp. %", "tip", "yielding joints")


def modes_command(
    robot: StudiedRobotOption = "kr210",
    payload: PayloadOption = None,
    elasticity: Annotated[
        str, typer.Option(metavar="NAME", help="structure, or joints for elastic gears alone.")
    ] = "structure",
    grid: GridOption = 25,
    mode: Annotated[int, typer.Option("--shape", metavar="N", help="Which mode is animated, from 1.")] = 1,
    out: PictureOption = Path("out/modes.html"),
    animation: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.html",
            help="Animation of the mode, arm stretched.",
            show_default="beside --report, as out/modes-animation.html",
        ),
    ] = None,
    json_file: JsonOption = None,
    meshcat: Annotated[bool, typer.Option("--meshcat", help="Show the motion live in a browser.")] = False,
) -> None:
    """Compute the natural frequencies and mode shapes of a robot with its motors held."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        model = noted_robot(human, robot)
        mass = model.payload.largest_mass if payload is None else payload
        if not 1 <= mode <= SHOWN_MODES:
            raise ValueError(f"--shape must be between 1 and {SHOWN_MODES}, got {mode}")
        animation = animation or out.with_name(f"{out.stem}-animation.html")
        page, motion = (stack.enter_context(staged_file(path, *PAGE)) for path in (out, animation))
        stack.enter_context(output.staged())
        with progress_bar(f"{grid * grid} positions") as progress:
            study = study_modes(model, elasticity, mass, grid, progress)
        # Without --meshcat nothing connects to the server, so any port will do.
        server = show_mode(model, elasticity, study.theta, study.stretched, mode - 1, None if meshcat else 0)
        title = f"mode {mode} of {model.name}, {study.stretched.frequency_hz[mode - 1]:.2f} Hz"
        write_animation(motion, server, title)
        write_modes_page(page, study)
        output.write(with_assumed(modes_json(study), model))
    title = f"{model.name}, {mass:g} kg, motors held, stretched"
    print_table(human, _table(title, STRETCHED_HEAD, stretched_rows(study, joints=3)))
    title = f"over {grid} x {grid} positions of axes 2 and 3"
    print_table(human, _table(title, WORKSPACE_HEAD, workspace_rows(study, joints=2)))
    human.print(escape(modes_verdict(study)))
    print_files(human, out, animation)
    if meshcat:
        human.print(f"Mode {mode} swings at {server.web_url()}")
        wait_for_interrupt(human, "Ctrl-C ends it")


def stretched_rows(study: ModalStudy, joints: int) -> list[list[str]]:
    """A row for each shown mode where the arm is stretched, with the joints that yield most."""
    return [
        [
            str(k + 1),
            f"{study.stretched.frequency_hz[k]:.2f}",
            f"{100.0 * study.stretched.damping_ratio[k]:.1f}",
            *_shape(study, k, joints, everywhere=False),
        ]
        for k in range(SHOWN_MODES)
    ]


def workspace_rows(study: ModalStudy, joints: int) -> list[list[str]]:
    """A row for each shown mode over the workspace, with the joints that yield most on the average."""
    rows = []
    for k in range(SHOWN_MODES):
        frequency, damping = spread(study.frequency_hz[..., k]), spread(100.0 * study.damping_ratio[..., k])
        rows.append(
            [
                str(k + 1),
                f"{frequency['min']:.1f}-{frequency['max']:.1f}",
                f"{frequency['median']:.1f}",
                f"{damping['min']:.1f}-{damping['max']:.1f}",
                *_shape(study, k, joints, everywhere=True),
            ]
        )
    return rows


def _shape(study: ModalStudy, mode: int, joints: int, everywhere: bool) -> tuple[str, str]:
    """How the tip moves most, and the joints that yield most, as many as asked for."""
    motion = next(iter(study.tip_motion(mode, everywhere)))
    energy_share = list(study.energy_share(mode, everywhere).items())[:joints]
    names = ", ".join(f"{_label(name)} {100.0 * part:.0f}%" for name, part in energy_share)
    return motion, names


def _label(name: str) -> str:
    """The name of a sprung joint as a reader says it: deflection_2 is gear 2, tilt_a_2 is tilt 2a."""
    kind, *rest = name.split("_")
    if kind == "tilt":
        letter, number = rest
        return f"tilt {number}{letter}"
    return " ".join(["gear" if kind == "deflection" else kind, *rest])


def _table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, title=escape(title), title_justify="left", title_style="italic")
    for name in head:
        is_text = name in ("tip", "yielding joints")
        table.add_column(name, justify="left" if is_text else "right", no_wrap=not is_text)
    for row in rows:
        table.add_row(*map(escape, row))
    return table


def modes_verdict(study: ModalStudy) -> str:
    """The slowest position, in one sentence."""
    lowest = study.frequency_hz[..., 0]
    i, j = np.unravel_index(np.argmin(lowest), lowest.shape)
    q2, q3 = np.rad2deg([study.axis_2[i], study.axis_3[j]])
    return (
        f"The lowest mode is between {lowest.min():.2f} and {lowest.max():.2f} Hz over the range of axes 2 "
        f"and 3, the slowest at {q2:.0f} and {q3:.0f} degrees."
    )


def write_modes_page(path: Path, study: ModalStudy) -> None:
    """The picture as a page that opens offline."""
    figure = frequency_figure(np.rad2deg(study.axis_2), np.rad2deg(study.axis_3), study.frequency_hz[..., 0])
    note = "Motors held, the other axes at zero. Positions where the arm would meet itself are not left out."
    sections = [
        Section("Lowest natural frequency", note, figure, 560),
        Section(
            "Lowest modes, stretched",
            "Damping of a hundred percent swings no more. How the tip moves most: in and out of the robot, "
            "sideways, up and down, or turning in place. The joints that yield, by their share of the strain "
            "energy: gear 2 is that of axis 2, tilt 2a and 2b its bearing, beam 2 the link behind it.",
            html_table(STRETCHED_HEAD, stretched_rows(study, joints=5)),
        ),
        Section(
            "Lowest modes over the workspace",
            "The spread over the positions of axes 2 and 3; tip and joints on the average of all positions.",
            html_table(WORKSPACE_HEAD, workspace_rows(study, joints=5)),
        ),
    ]
    title = f"Modes, {study.robot.name}, {study.payload:g} kg"
    write_plot_page(path, title, modes_verdict(study), sections)

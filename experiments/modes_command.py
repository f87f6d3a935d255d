"""``truetip modes``: natural frequencies of an elastic robot over its workspace, as numbers and pictures."""

import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.console import progress_bar, refusing
from experiments.metrics import json_text, write_json
from experiments.modes_view import frequency_figure, show_mode, write_animation
from experiments.plot_page import Section, html_table, write_plot_page
from experiments.staging import staged_file
from robots.model import RobotModel, load_robot
from robots.modes import ModalAnalysis, Modes, stretched

SHOWN_MODES = 6
JOINTS_HEAD = "yielding joints"
HEAD = ("mode", "Hz", "damp. %", JOINTS_HEAD, "min Hz", "median", "max Hz")


@dataclass(frozen=True)
class ModalStudy:
    """The modes of one robot, stretched and over a grid of its axes 2 and 3; all other axes at zero."""

    robot: RobotModel
    elasticity: str
    payload: float  # kg
    theta: np.ndarray  # (6,) rad, the stretched position
    stretched: Modes
    axis_2: np.ndarray  # (n,) rad
    axis_3: np.ndarray  # (m,) rad
    frequency_hz: np.ndarray  # (n, m, shown modes)
    damping_ratio: np.ndarray  # (n, m, shown modes)


def study_modes(
    robot: RobotModel,
    elasticity: str,
    payload: float,
    grid: int,
    progress: Callable[[float], None] | None = None,
) -> ModalStudy:
    """Finds the modes at grid x grid positions of axes 2 and 3 within their limits.

    Raises:
        ValueError: if the grid is too small, or `ModalAnalysis` refuses the robot.
    """
    if grid < 2:
        raise ValueError(f"--grid must be at least 2, got {grid}")
    analysis = ModalAnalysis(robot, elasticity, payload)
    theta = stretched(robot)
    axis_2, axis_3 = np.linspace(robot.lower[1:3], robot.upper[1:3], grid).T
    frequency, damping = np.empty((2, grid, grid, SHOWN_MODES))
    for i, q2 in enumerate(axis_2):
        for j, q3 in enumerate(axis_3):
            modes = analysis.at(np.array([0.0, q2, q3, 0.0, 0.0, 0.0]))
            frequency[i, j] = modes.frequency_hz[:SHOWN_MODES]
            damping[i, j] = modes.damping_ratio[:SHOWN_MODES]
        if progress:
            progress((i + 1) / grid)
    at_reach = analysis.at(theta)
    return ModalStudy(robot, elasticity, payload, theta, at_reach, axis_2, axis_3, frequency, damping)


def modes_command(
    robot: Annotated[
        str, typer.Option("--robot", metavar="NAME|FILE", help="A shipped robot or a YAML file.")
    ] = "kr210",
    payload: Annotated[
        float | None,
        typer.Option(metavar="KG", help="Mass at the flange.", show_default="the largest it may carry"),
    ] = None,
    elasticity: Annotated[
        str, typer.Option(metavar="NAME", help="structure, or joints for elastic gears alone.")
    ] = "structure",
    grid: Annotated[int, typer.Option(metavar="N", help="Positions of axis 2, and of axis 3.")] = 25,
    mode: Annotated[int, typer.Option(metavar="N", help="The mode that is animated, from 1.")] = 1,
    out: Annotated[Path, typer.Option(metavar="FILE.html", help="The picture.")] = Path("out/modes.html"),
    animation: Annotated[
        Path, typer.Option(metavar="FILE.html", help="The mode in motion, stretched.")
    ] = Path("out/modes-animation.html"),
    json_file: Annotated[
        str | None,
        typer.Option("--json", metavar="FILE", help="The numbers; - prints them, and nothing else."),
    ] = None,
    meshcat: Annotated[bool, typer.Option("--meshcat", help="Show the motion live in a browser.")] = False,
) -> None:
    """Find out how fast a robot swings with its motors held, and which joints yield."""
    human = Console(stderr=json_file == "-")
    with refusing(ValueError, OSError), ExitStack() as stack:
        model = load_robot(robot)
        mass = model.payload.largest_mass if payload is None else payload
        if not 1 <= mode <= SHOWN_MODES:
            raise ValueError(f"--mode must be between 1 and {SHOWN_MODES}, got {mode}")
        page, motion = (stack.enter_context(staged_file(path)) for path in (out, animation))
        copy = stack.enter_context(staged_file(json_file)) if json_file not in (None, "-") else None
        with progress_bar(f"{grid * grid} positions") as progress:
            study = study_modes(model, elasticity, mass, grid, progress)
        # Without --meshcat nothing connects to the server, so any port will do.
        server = show_mode(model, elasticity, study.theta, study.stretched, mode - 1, None if meshcat else 0)
        title = f"mode {mode} of {model.name}, {study.stretched.frequency_hz[mode - 1]:.2f} Hz"
        write_animation(motion, server, title)
        write_modes_page(page, study)
        if copy:
            write_json(copy, modes_json(study))
    if json_file == "-":
        sys.stdout.write(json_text(modes_json(study)))
    human.print(modes_table(study))
    human.print(escape(modes_verdict(study)))
    for path in (out, animation):
        human.print(escape(str(path)), soft_wrap=True)
    if meshcat:
        human.print(f"Mode {mode} swings at {server.web_url()}")
        if sys.stdin.isatty() and sys.stdout.isatty():
            _wait(human)


def modes_rows(study: ModalStudy, num_joints: int) -> list[list[str]]:
    """A row for each shown mode: where stretched with the joints that yield most, then over the grid."""
    rows = []
    for k in range(SHOWN_MODES):
        frequency = f"{study.stretched.frequency_hz[k]:.2f}"
        damping = f"{100.0 * study.stretched.damping_ratio[k]:.1f}"
        dominant = study.stretched.dominant_joints(k, num_joints)
        joints = ", ".join(f"{_label(name)} {100.0 * share:.0f}%" for name, share in dominant)
        spread = (f"{value:.1f}" for value in _spread(study.frequency_hz[..., k]).values())
        rows.append([str(k + 1), frequency, damping, joints, *spread])
    return rows


def _label(name: str) -> str:
    """The name of a sprung joint as a reader says it: deflection_2 is gear 2, tilt_a_2 is tilt 2a."""
    kind, *rest = name.split("_")
    if kind == "tilt":
        letter, number = rest
        return f"tilt {number}{letter}"
    return " ".join(["gear" if kind == "deflection" else kind, *rest])


def modes_table(study: ModalStudy) -> Table:
    """The lowest modes for a terminal."""
    title = f"{study.robot.name}, {study.payload:g} kg, motors held: stretched, then over axes 2 and 3"
    table = Table(box=box.SIMPLE_HEAD, title=escape(title), title_justify="left", title_style="italic")
    for name in HEAD:
        is_text = name == JOINTS_HEAD
        table.add_column(name, justify="left" if is_text else "right", no_wrap=not is_text)
    for row in modes_rows(study, num_joints=2):
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


def modes_json(study: ModalStudy) -> dict[str, Any]:
    """The numbers, with the units in their names."""
    shown, modes = range(SHOWN_MODES), study.stretched
    return {
        "robot": study.robot.name,
        "elasticity": study.elasticity,
        "payload_kg": study.payload,
        "stretched": {
            "position_deg": np.rad2deg(study.theta).tolist(),
            "frequency_hz": modes.frequency_hz[:SHOWN_MODES].tolist(),
            "damping_ratio": modes.damping_ratio[:SHOWN_MODES].tolist(),
            "energy_share": [dict(modes.dominant_joints(k, len(modes.joints))) for k in shown],
        },
        "workspace": {
            "axis_2_deg": np.rad2deg(study.axis_2).tolist(),
            "axis_3_deg": np.rad2deg(study.axis_3).tolist(),
            "lowest_frequency_hz": study.frequency_hz[..., 0].tolist(),
            "frequency_hz": [_spread(study.frequency_hz[..., k]) for k in shown],
            "damping_ratio": [_spread(study.damping_ratio[..., k]) for k in shown],
        },
    }


def write_modes_page(path: Path, study: ModalStudy) -> None:
    """The picture as a page that opens offline."""
    figure = frequency_figure(np.rad2deg(study.axis_2), np.rad2deg(study.axis_3), study.frequency_hz[..., 0])
    note = "Motors held, the other axes at zero. Positions where the arm would meet itself are not left out."
    sections = [
        Section("Lowest natural frequency", note, figure, 560),
        Section(
            "Lowest modes",
            "Stretched, then the spread over axes 2 and 3. Shares are those of the strain energy.",
            html_table(HEAD, modes_rows(study, num_joints=4)),
        ),
    ]
    title = f"Modes, {study.robot.name}, {study.payload:g} kg"
    write_plot_page(path, title, modes_verdict(study), sections)


def _spread(values: np.ndarray) -> dict[str, float]:
    return {"min": float(values.min()), "median": float(np.median(values)), "max": float(values.max())}


def _wait(console: Console) -> None:
    console.print("Ctrl-C ends it")
    try:
        while True:
            time.sleep(1.0)
    except KeyboardInterrupt:
        console.print()

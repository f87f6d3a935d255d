"""``truetip cameras budget``: how uncertain measured poses are along a path, and why."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import plotly.graph_objects as go
import typer
from rich.markup import escape

from experiments.cameras.budget import Budget, budget
from experiments.cli.console import print_files, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least, not_negative
from experiments.cli.options import JsonOption, PictureOption, ScenarioOption, SetOption
from experiments.cli.prepare import prepare
from experiments.cli.staging import PAGE, staged_file
from experiments.report.figure_style import COLORS
from experiments.report.plot_page import Section, html_table, write_plot_page
from systems.vision.uncertainty.pose_uncertainty import (
    CAMERAS,
    IMAGES,
    TEMPERATURE,
    TIME,
    TOOL,
    Uncertainties,
)

_GIVEN = Uncertainties()
_COVERAGE = 2.0  # of the expanded uncertainty


def budget_command(
    scenario: ScenarioOption = "misaligned",
    settings: SetOption = None,
    recording: Annotated[
        str | None,
        typer.Option(metavar="FILE.mcap", help="Poses of a recorded run in place of the scenario's path."),
    ] = None,
    pixel: Annotated[
        float, typer.Option("--pixel-sigma", metavar="PX", help="Noise of an image coordinate of a marker.")
    ] = _GIVEN.pixel,
    camera_mm: Annotated[
        float,
        typer.Option("--camera-mm", metavar="MM", help="Standard deviation of the place of each camera."),
    ] = 1e3 * _GIVEN.camera_position,
    camera_urad: Annotated[
        float,
        typer.Option(
            "--camera-urad", metavar="URAD", help="Standard deviation of the direction of each camera."
        ),
    ] = 1e6 * _GIVEN.camera_rotation,
    tool_mm: Annotated[
        float,
        typer.Option(
            "--tool-mm", metavar="MM", help="Standard deviation of the tool in the frame of the markers."
        ),
    ] = 1e3 * _GIVEN.tool_position,
    time_ms: Annotated[
        float,
        typer.Option(
            "--time-ms", metavar="MS", help="Standard deviation of time stamps between camera and robot."
        ),
    ] = 1e3 * _GIVEN.time_stamp,
    temperature: Annotated[
        float, typer.Option(metavar="K", help="By which the cell is warmer or colder at most.")
    ] = _GIVEN.temperature,
    draws: Annotated[
        int, typer.Option(metavar="N", help="Draws of the Monte Carlo at each of five poses.")
    ] = 400,
    out: PictureOption = Path("out/budget.html"),
    json_file: JsonOption = None,
) -> None:
    """Say how uncertain measured poses are along a path, and which cause has which share."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        at_least("--draws", 100, draws)
        for name, value in (
            ("--pixel-sigma", pixel), ("--camera-mm", camera_mm), ("--camera-urad", camera_urad),
            ("--tool-mm", tool_mm), ("--time-ms", time_ms), ("--temperature", temperature),
        ):  # fmt: skip
            not_negative(name, value)
        given = Uncertainties(
            pixel, 1e-3 * camera_mm, 1e-6 * camera_urad, 1e-3 * tool_mm, _GIVEN.tool_rotation,
            1e-3 * time_ms, temperature,
        )  # fmt: skip
        prepared = prepare(scenario, [*(settings or []), "station.camera=images"])
        page = stack.enter_context(staged_file(out, *PAGE))
        stack.enter_context(output.staged())
        with progress_bar("Monte Carlo") as progress:
            found = budget(prepared, given, recording, draws, progress)
        verdict = budget_verdict(found)
        title = f"Budget of uncertainty, {Path(recording).name if recording else prepared.title}"
        write_budget_page(page, title, verdict, found, given)
        output.write(found.as_dict())
    human.print(escape(verdict))
    print_files(human, out)


def budget_verdict(found: Budget) -> str:
    """The budget in a few sentences."""
    numbers = found.as_dict()
    shares = sorted(numbers["shares"].items(), key=lambda share: -share[1])
    named = ", ".join(f"{name} {100.0 * share:.0f} %" for name, share in shares)
    position = numbers["position_um"]
    hidden = numbers["poses"] - numbers["seen"]
    return (
        f"Standard uncertainty of a measured position: {position['median']:.0f} µm in the median, "
        f"{position['largest']:.0f} µm at most ({_COVERAGE * position['largest']:.0f} µm expanded, k = 2). "
        f"Shares of its variance: {named}. The Monte Carlo is within "
        f"{100.0 * numbers['simulated_deviation']:.0f} % of it."
        + (f" {hidden} of {numbers['poses']} poses are not seen." if hidden else "")
    )


def write_budget_page(path: Path, title: str, verdict: str, found: Budget, given: Uncertainties) -> None:
    """The page of a budget; opens offline."""
    sections = [
        Section(
            "Along the path",
            "The height is the standard uncertainty of the position, root of the summed variances of its "
            "coordinates; each cause has the part of it that it has in the variance. Crosses are the Monte "
            "Carlo: true cameras, warm bodies and late stamps drawn at random, nothing linearised.",
            _stacked(found),
        ),
        Section(
            "Speed of the tool", "A time stamp that is wrong costs speed times time.", _speed(found), 260
        ),
        Section(
            "What it is made of",
            "Standard uncertainties that were assumed (type B), each camera and axis by itself; the "
            "temperature is evenly distributed and warms everything alike. Of the camera's own noise it is "
            "that of one image, not of a mean.",
            html_table(("cause", "assumed", "mean share of the variance"), _rows(found, given)),
        ),
    ]
    write_plot_page(path, title, verdict, sections)


def _stacked(found: Budget) -> go.Figure:
    figure = go.Figure()
    for colour, (name, share) in zip(COLORS, found.shares().items(), strict=False):
        figure.add_scatter(
            x=found.time, y=1e6 * share * found.position, name=name, stackgroup="causes",
            mode="lines", line={"color": colour, "width": 0.5},
        )  # fmt: skip
    figure.add_scatter(
        x=found.time[found.checked], y=1e6 * found.simulated, name="Monte Carlo", mode="markers",
        marker={"symbol": "x", "size": 9, "color": "#5b6675"},
    )  # fmt: skip
    figure.update_layout(xaxis_title="time in s", yaxis_title="standard uncertainty in µm")
    figure.update_xaxes(range=[found.time[0], found.time[-1]])
    return figure


def _speed(found: Budget) -> go.Figure:
    figure = go.Figure(go.Scatter(x=found.time, y=found.speed, mode="lines", name="speed"))
    figure.update_layout(xaxis_title="time in s", yaxis_title="speed in m/s")
    return figure


def _rows(found: Budget, given: Uncertainties) -> list[list[str]]:
    said = {
        IMAGES: f"{given.pixel:g} px for each marker in each image",
        CAMERAS: f"{1e3 * given.camera_position:g} mm and {1e6 * given.camera_rotation:g} microradians",
        TOOL: f"{1e3 * given.tool_position:g} mm and {1e6 * given.tool_rotation:g} microradians",
        TIME: f"{1e3 * given.time_stamp:g} ms",
        TEMPERATURE: f"±{given.temperature:g} K; frame {1e6 * given.frame_expansion:g} and body "
        f"{1e6 * given.body_expansion:g} ppm/K",
    }
    return [[name, said[name], f"{100.0 * share:.1f} %"] for name, share in found.mean_shares().items()]

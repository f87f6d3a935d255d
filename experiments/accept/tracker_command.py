"""``truetip accept tracker``: the record of a run against what a second instrument saw of it."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import plotly.graph_objects as go
import typer
from rich.markup import escape

from diagrams.record.read_record import Contents, read_record
from diagrams.record.restored import exposures
from diagrams.record.topics import JOINTS, POSE
from diagrams.scenario.differences import scenario_tree
from experiments.accept.tracker_table import FEWEST, UNITS, read_tracker
from experiments.cli.console import print_files, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import positive
from experiments.cli.options import JsonOption, PictureOption
from experiments.cli.staging import PAGE, staged_file
from experiments.report.plot_page import Section, html_table, write_plot_page
from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics
from robots.metrology.instrument_comparison import Fit, Followed, Share, fitted, share_of_first
from robots.pose import zyx_from_rotation

_ROBOT = "irb1200"  # of a record that does not say
_SAID = {
    "first": "the camera explains them",
    "second": "the second instrument explains them",
    "both": "both have a part in them",
    "": "which of the two is wrong cannot be told from this motion",
}


def accept_tracker_command(
    record: Annotated[str, typer.Argument(metavar="RUN.mcap", help="The record of a run.")],
    seen: Annotated[
        str,
        typer.Argument(
            metavar="SEEN.csv", help="Time in s and x, y, z of a target on the tool, a line each."
        ),
    ],
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot",
            metavar="NAME|FILE",
            help="Whose joints tell which instrument is wrong.",
            show_default="that of the record",
        ),
    ] = None,
    unit: Annotated[str, typer.Option(metavar="mm|m", help="Unit of the coordinates.")] = "mm",
    window: Annotated[float, typer.Option(metavar="S", help="By which the clocks may differ at most.")] = 2.0,
    out: PictureOption = Path("out/accept-tracker.html"),
    json_file: JsonOption = None,
) -> None:
    """Compare the camera of a run with a second instrument, such as a laser tracker."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        positive("--window", window)
        if unit not in UNITS:
            raise ValueError(f"--unit must be mm or m, got '{unit}'")
        contents = read_record(record)
        name = robot or str(scenario_tree(contents.scenario).get("robot", _ROBOT))
        kinematics = Kinematics(load_robot(name))
        page = stack.enter_context(staged_file(out, *PAGE))
        stack.enter_context(output.staged())
        camera, joints = _recorded(record, contents, kinematics)
        second = _fitted(f"{record} and {seen} in {unit}", camera, read_tracker(seen, unit), window)
        third = _fitted(f"camera and joints of {record} with --robot {name}", camera, joints, window)
        share = share_of_first(second, third)
        verdict = tracker_verdict(second, share)
        write_tracker_page(page, f"{Path(record).name} and {Path(seen).name}", verdict, second, share)
        output.write(_numbers(second, share))
    human.print(escape(verdict))
    print_files(human, out)


def _fitted(what: str, first: Followed, second: Followed, window: float) -> Fit:
    """`fitted`, whose refusals say of what they are. Raises ValueError."""
    try:
        return fitted(first, second, window)
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from error


def _recorded(record: str, contents: Contents, kinematics: Kinematics) -> tuple[Followed, Followed]:
    """What the camera and what the joints say of the tool. Raises ValueError."""
    if lacking := contents.lacking(JOINTS, POSE):
        raise ValueError(f"record {record}: {lacking}")
    if contents.cut:
        typer.echo(f"truetip: record {record} {contents.cut}; what is there is used", err=True)
    exposed, X_WE = exposures(contents.topics[POSE])
    exposed, unique = np.unique(exposed, return_index=True)
    time, rows = np.unique(contents.topics[JOINTS].time, return_index=True)
    for number, what in ((len(exposed), "exposures"), (len(time), "samples of the joints")):
        if number < FEWEST:
            raise ValueError(f"record {record}: {number} {what}, at least {FEWEST} are needed")
    X = kinematics.forward(contents.topics[JOINTS].columns["position"][rows])
    seen = X_WE[unique]
    return Followed(exposed, seen[:, :3, 3], seen[:, :3, :3]), Followed(time, X[:, :3, 3])


def tracker_verdict(second: Fit, share: Share) -> str:
    """The comparison in a few sentences."""
    distance = np.linalg.norm(second.residual, axis=1)
    return (
        f"The instruments differ by {1e3 * second.rms:.4f} mm (root mean square of the distances), "
        f"{1e3 * distance.max():.4f} mm at most, after the clock of the second was moved by "
        f"{1e3 * second.lag:.2f} ms. Of the mean square {100.0 * share.first:.0f} % ± "
        f"{100.0 * share.sigma:.0f} % is the camera's: {_SAID[share.culprit]}."
    )


def write_tracker_page(path: Path, title: str, verdict: str, second: Fit, share: Share) -> None:
    """The page of a comparison; opens offline."""
    along = go.Figure()
    for name, values in zip(("x", "y", "z"), 1e3 * second.residual.T, strict=True):
        along.add_scatter(x=second.time, y=values, name=name, mode="lines")
    along.update_layout(xaxis_title="time in s", yaxis_title="camera − second in mm")
    spread = go.Figure(go.Histogram(x=1e3 * np.linalg.norm(second.residual, axis=1), nbinsx=80))
    spread.update_layout(xaxis_title="distance in mm", yaxis_title="samples")
    note = (
        "Lag, frame and target were adjusted together. The camera's share of the mean square is the part "
        "that its difference from the robot's joints has, too (Grubbs 1948); it holds where the joints are "
        "wrong in their own way. The target is known only where the tool turns by more than 0.2 rad."
    )
    sections = [
        Section(
            "Along the motion",
            "In the world, after the adjustment. Noise about zero is left where both see the same; a wave is "
            "something that one of them sees and the other does not.",
            along,
        ),
        Section("How large", "How many samples are how far apart.", spread, 300),
        Section("What was adjusted", note, html_table(("what", "value"), _rows(second, share))),
    ]
    write_plot_page(path, f"Second instrument, {title}", verdict, sections)


def _rows(second: Fit, share: Share) -> list[list[str]]:
    p = 1e3 * second.X_12.translation()
    angles = np.rad2deg(zyx_from_rotation(second.X_12.rotation().matrix()))
    return [
        ["its clock is late by", f"{1e3 * second.lag:.3f} ms"],
        ["its frame in the world", "mm: " + ", ".join(f"{value:.3f}" for value in p)],
        ["turned by (ZYX)", "degrees: " + ", ".join(f"{value:.4f}" for value in angles)],
        ["its target in the tool", "mm: " + ", ".join(f"{1e3 * value:.3f}" for value in second.offset)],
        ["the camera's share", f"{100.0 * share.first:.0f} % ± {100.0 * share.sigma:.0f} %"],
    ]


def _numbers(second: Fit, share: Share) -> dict[str, Any]:
    return {
        "lag_s": second.lag,
        "rms_mm": 1e3 * second.rms,
        "largest_mm": 1e3 * float(np.linalg.norm(second.residual, axis=1).max()),
        "frame": second.X_12.GetAsMatrix4().tolist(),
        "target_in_tool_mm": (1e3 * second.offset).tolist(),
        "share_of_camera": share.first,
        "share_sigma": share.sigma,
        "explained_by": {"first": "camera", "second": "second"}.get(
            share.culprit, share.culprit or "unknown"
        ),
    }

"""``truetip health``: a daily check that names what has changed: a camera, a joint or the tool."""

import time
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import plotly.graph_objects as go
import typer
from rich.markup import escape

from experiments.cli.console import count, print_files, print_note, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least
from experiments.cli.options import (
    JsonOption,
    PictureOption,
    RobotOption,
    SetOption,
    StationOption,
    WithCellOption,
    YesOption,
)
from experiments.cli.prepare import Prepared, prepare, with_assumed
from experiments.cli.staging import PAGE, staged_file
from experiments.health.history import History, read_history, write_history
from experiments.health.station import check_on_station
from experiments.health.study import DAY, NOISE, HealthStudy, Injected, deviations
from experiments.report.plot_page import Section, html_table, write_plot_page
from experiments.station.guided_command import ask_before_moving, check_measures_alone, on_station
from robots.description.model import RobotModel
from robots.metrology.daily_check import TOOL, sizes_alone
from systems.link.udp_channel import ChannelError

_HISTORY = (".parquet",)
_AID = "An aid, not a safety function."


def health_command(
    scenario: Annotated[
        str | None,
        typer.Option(
            "--scenario",
            metavar="NAME|FILE",
            help="A shipped scenario or a YAML file.",
            show_default="nominal; on a station cell or cell-kuka",
        ),
    ] = None,
    settings: SetOption = None,
    robot: RobotOption = None,
    history: Annotated[
        Path, typer.Option(metavar="FILE.parquet", help="Checks so far; new ones are appended.")
    ] = Path("out/health.parquet"),
    checks: Annotated[int, typer.Option(metavar="N", help="How many checks to run, one a day.")] = 1,
    change: Annotated[
        str | None,
        typer.Option(
            metavar="KIND:...",
            help="Change the simulated station: joint:3:40 (mdeg), tool:0.2 (mm), "
            "camera:04:50 (microradians), marker:5:0.1 (mm), marker:5:lost.",
        ),
    ] = None,
    change_at: Annotated[
        int | None,
        typer.Option(
            "--change-at",
            metavar="N",
            help="The check in which it changes.",
            show_default="the first new one, and not the first of all for joint and tool",
        ),
    ] = None,
    cell: Annotated[str, typer.Option(metavar="NAME|FILE", help="The cameras.")] = "probst",
    station: StationOption = None,
    with_cell: WithCellOption = False,
    yes: YesOption = False,
    out: PictureOption = Path("out/health.html"),
    json_file: JsonOption = None,
) -> None:
    """Check cameras, joints and tool of a station, and name what has changed since the first check.

    On a station of hardware the robot is guided to the six poses, and its joints and tool are checked.
    """
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError, ChannelError), ExitStack() as stack:
        at_least("--checks", 1, checks)
        name, changes = on_station(scenario, settings or [], station, with_cell, simulated="nominal")
        prepared = prepare(name, changes, robot, needs_path=False)
        is_simulated = prepared.scenario.station.kind == "simulated"
        if not is_simulated:
            _refuse_on_station(prepared, checks, change)
        study = HealthStudy(prepared.scenario, prepared.robot, cell)
        before = read_history(history) if history.exists() else study.begun()
        study.refuse(before, is_simulated)
        injected = Injected.parse(change, study.names) if change else None
        if change_at is not None and injected is None:
            raise ValueError("--change-at needs --change")
        # Joints and tool are held against the first check: one that has changed before it looks well.
        compared = 2 if injected is not None and injected.is_of_robot else 1
        first = max(len(before.time) + 1, compared) if change_at is None else change_at
        at_least("--change-at", compared, first)
        if first > len(before.time) + checks and change_at is None:
            raise ValueError(
                f"--change {change}: joints and tool are held against the first check, which {history} does "
                "not have yet; say --checks 2 or more"
            )
        if first > len(before.time) + checks:
            raise ValueError(
                f"--change-at {first}: the last check of this run is {len(before.time) + checks}"
            )
        page = stack.enter_context(staged_file(out, *PAGE))
        table = stack.enter_context(staged_file(history, *_HISTORY))
        stack.enter_context(output.staged())
        print_note(human, prepared.note)
        if not is_simulated:
            ask_before_moving(human, prepared, with_cell or yes)
        with progress_bar(count(checks, "check")) as progress:
            if is_simulated:
                after = study.continued(before, checks, injected, first, progress)
            else:
                X_WE = check_on_station(prepared, study.q, with_cell, progress)
                after = study.measured(before, X_WE, time.time())
        alarms = study.alarms(after)
        write_history(table, after)
        verdict = _verdict(after, alarms)
        _write_page(page, f"Health, {prepared.title}", verdict, after, prepared.robot, alarms)
        numbers = {"alarms": alarms, "history": str(history), "checks": len(after.time)}
        output.write(with_assumed(numbers, prepared.robot) if is_simulated else numbers)
    human.print(escape(verdict))
    print_files(human, out, history)


def _refuse_on_station(prepared: Prepared, checks: int, change: str | None) -> None:
    """Refuses what a station of hardware cannot do. Raises ValueError."""
    station = prepared.scenario.station
    if change is not None:
        raise ValueError("--change changes a simulated station; leave it out")
    if checks != 1:
        raise ValueError(f"--checks is of a simulated station, this one is checked once, got {checks}")
    check_measures_alone("health", station)


def _verdict(history: History, alarms: list[dict[str, Any]]) -> str:
    said = f"{count(len(history.time), 'check')} of {history.robot}: "
    if not alarms:
        return said + f"nothing has changed. {_AID}"
    return said + "; ".join(map(_in_words, alarms)) + f". {_AID}"


def _in_words(alarm: dict[str, Any]) -> str:
    size, unit = _shown(alarm["size"], alarm["kind"])
    sigma, _ = _shown(alarm["sigma"], alarm["kind"])
    day = alarm["onset_s"] / DAY
    if not alarm["sigma"]:  # whether, not by how much
        return f"{alarm['what']} since day {round(day, 3):g}: {alarm['suggestion']}"
    scatter = float(f"{sigma:.1g}")
    others = alarm.get("perhaps", [])  # a history from before has none
    like = f" (or {', '.join(others)}, which would look much the same)" if others else ""
    said = f"{alarm['what']}{like} changed by {abs(size):.3g} ± {scatter:g} {unit} on day {round(day, 3):g}"
    return f"{said}: {alarm['suggestion']}"


def _shown(size: float, kind: str) -> tuple[float, str]:
    """A size in the unit in which people think of it."""
    if kind == "camera":
        return 1e6 * size, "microradians"
    if kind in (TOOL, "marker"):
        return 1e3 * size, "mm"
    return float(1e3 * np.rad2deg(size)), "mdeg"


def _write_page(
    path: Path, title: str, verdict: str, history: History, robot: RobotModel, alarms: list[dict[str, Any]]
) -> None:
    day = (history.time - history.time[0]) / DAY
    sizes = sizes_alone(robot, history.q, deviations(history), NOISE)
    joints, tool, cameras = go.Figure(), go.Figure(), go.Figure()
    for name, values in sizes.items():
        if name == TOOL:
            tool.add_trace(go.Scatter(x=day, y=1e3 * values, mode="lines+markers", name=name))
        else:
            shown = 1e3 * np.rad2deg(values)
            joints.add_trace(go.Scatter(x=day, y=shown, mode="lines+markers", name=name))
    for i, name in enumerate(history.cameras):
        turn = 1e6 * np.linalg.norm(history.rotations[:, i], axis=1)
        cameras.add_trace(go.Scatter(x=day, y=turn, mode="lines+markers", name=name))
    for figure, unit in ((joints, "change in mdeg"), (tool, "shift in mm"), (cameras, "turn in µrad")):
        figure.update_layout(xaxis={"title": "day"}, yaxis={"title": unit})
    rows = [[alarm["kind"], _in_words(alarm)] for alarm in alarms]
    sections = [
        Section(
            "Zeros of the joints", "How large each change would be if it were the only one.", joints, 380
        ),
        Section("Tool", "Likewise its shift from the first check.", tool, 300),
    ]
    if np.isfinite(history.rotations).any():
        turned = "By how much they have turned since they were calibrated."
        sections.append(Section("Cameras", turned, cameras, 380))
    if rows:
        sections.insert(0, Section("Alarms", "", html_table(("kind", "what"), rows)))
    write_plot_page(path, title, verdict, sections)

"""``truetip latency``: measures the delays of a station."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import numpy as np
import plotly.graph_objects as go
import typer
from rich import box
from rich.table import Table

from diagrams.hardware_link import EndedOnRequest
from diagrams.runs.latency import LatencyConfig, LatencyRecord, measure_latency
from diagrams.scenario.scenario import Scenario, load_scenario
from experiments.cli.console import BROKEN_OFF, fail, print_files, print_table, progress_bar, refusing
from experiments.cli.ending import asking
from experiments.cli.json_output import human_console, json_output
from experiments.cli.options import (
    JsonOption,
    PictureOption,
    ScenarioOption,
    SetOption,
    WithCellOption,
    YesOption,
)
from experiments.cli.prepare import Prepared, prepare
from experiments.cli.staging import PAGE, YAML, staged_file
from experiments.report.files import write_text
from experiments.report.plot_page import Section, write_plot_page
from experiments.station.clients import station_clients
from experiments.station.found_delays import check_settings, scenario_with
from experiments.station.guided_command import ask_before_moving, on_station
from experiments.station.latency import ImpossibleDelayError, Latency, evaluate

_LEAST_RANGE_MS = 0.01  # of the plot of the clocks


def latency_command(
    scenario: ScenarioOption = "cell",
    settings: SetOption = None,
    with_cell: WithCellOption = False,
    yes: YesOption = False,
    joint: Annotated[int, typer.Option(metavar="N", help="Joint to move.")] = 1,
    amplitude: Annotated[float, typer.Option(metavar="DEG", help="Amplitude of the motion.")] = 4.0,
    duration: Annotated[float, typer.Option(metavar="S", help="Duration of the motion.")] = 20.0,
    report: PictureOption = Path("out/latency.html"),
    write: Annotated[
        str | None,
        typer.Option(metavar="FILE.yaml", help="A scenario with the delays that were found."),
    ] = None,
    json_file: JsonOption = None,
) -> None:
    """Measure the delays and clocks of a real station by moving one joint back and forth."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        config = LatencyConfig(joint, amplitude, duration)
        config.check()
        if write:
            check_settings(settings or [])
        link = load_scenario(scenario, settings).station.link.kind
        name, changes = on_station(scenario, list(settings or []), link, with_cell)
        prepared = prepare(name, changes)
        ask_before_moving(human, prepared, with_cell or yes)
        page = stack.enter_context(staged_file(report, *PAGE))
        written = stack.enter_context(staged_file(write, *YAML)) if write else None
        stack.enter_context(output.staged())
        record = _measured(prepared, config, with_cell)
        try:
            found = evaluate(record)
        except ImpossibleDelayError as error:
            fail(f"{error}; nothing was written", BROKEN_OFF)
            raise
        write_latency_page(page, found, record)
        if write and written:
            write_text(written, scenario_with(scenario, found, settings or [], Path(write)))
        output.write(found.as_dict())
    print_table(human, latency_table(found))
    print_files(human, report, write)


def _measured(prepared: Prepared, config: LatencyConfig, with_cell: bool) -> LatencyRecord:
    scenario: Scenario = prepared.scenario
    with (
        asking() as end,
        station_clients(scenario, prepared.robot, with_cell, True, camera_delay=0.0) as station,
        progress_bar(f"moving joint {config.joint}") as progress,
    ):
        try:
            return measure_latency(
                scenario,
                prepared.robot,
                config,
                station.client,
                station.camera,
                progress=progress,
                is_asked_to_end=end.is_asked,
            )
        except EndedOnRequest:
            fail("ended on request, nothing was written", end.code)
            raise


def latency_table(found: Latency) -> Table:
    """What was found, for people."""
    table = Table(box=box.SIMPLE_HEAD, title="Delays of the station", title_justify="left")
    table.add_column("what", no_wrap=True)
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("which is")
    loop_sigma, camera_sigma = 1e3 * found.loop_sigma, 1e3 * (found.camera_sigma or 0.0)
    rows: list[tuple[str, float | None, str, str]] = [
        ("controller: cycle", 1e3 * found.cycle, "ms", "between two messages"),
        (
            "controller: loop",
            1e3 * found.loop,
            "ms",
            f"± {loop_sigma:.2f}, from a command to the joint at it, by its own stamps",
        ),
        (
            "controller: dead time",
            1e3 * found.dead_time,
            "ms",
            f"± {loop_sigma:.2f}, the loop less one cycle, in which it is heard",
        ),
        (
            "camera: delay",
            None if found.camera is None else 1e3 * found.camera,
            "ms",
            f"± {camera_sigma:.2f}, from exposure to arrival",
        ),
        (
            "camera: drift",
            found.drift_ppm,
            "ppm",
            f"its clock gains it on the controller's, ± {found.drift_sigma_ppm or 0.0:.1f}",
        ),
        (
            "own turn-around",
            1e3 * found.turn_around["50%"],
            "ms",
            "median, from a message in to its reply out",
        ),
        ("own turn-around, 99 %", 1e3 * found.turn_around["99%"], "ms", ""),
    ]
    for line, levels in found.jitter.items():
        late = levels.get("99%", float("nan"))
        rows.append(
            (f"transport: jitter, {line}", 1e3 * late, "ms", "99 % arrive no later than the quickest + this")
        )
    for name, value, unit, text in rows:
        if value is not None and np.isfinite(value):
            table.add_row(name, f"{value:.2f} {unit}", text)
    return table


def write_latency_page(path: Path, found: Latency, record: LatencyRecord) -> None:
    """The motions over each other and the clocks against each other, as Probst (2024), figs. 6.6 and 6.7."""
    time = record.stamp - record.stamp[0]
    moved = go.Figure()
    for name, values, shift in (
        ("commanded", record.commanded, 0.0),
        ("measured", record.measured, 0.0),
        ("measured, moved back by the loop", record.measured, found.loop),
    ):
        moved.add_scatter(x=time - shift, y=np.rad2deg(values), name=name, mode="lines")
    moved.update_layout(xaxis_title="time in s", yaxis_title="joint in degrees")
    clocks = go.Figure()
    difference = 1e3 * (record.reported - record.reported[0] - time)
    clocks.add_scatter(x=time, y=difference, name="own clock less the controller's", mode="lines")
    clocks.update_layout(xaxis_title="time in s", yaxis_title="difference in ms")
    if len(difference) and np.ptp(difference) < _LEAST_RANGE_MS:  # clocks that agree: nothing but rounding
        middle = float(np.mean(difference))
        clocks.update_yaxes(range=[middle - _LEAST_RANGE_MS, middle + _LEAST_RANGE_MS])
    spread = go.Figure(go.Histogram(x=1e3 * record.turn_around, nbinsx=100))
    spread.update_layout(xaxis_title="turn-around in ms", yaxis_title="replies")
    verdict = (
        f"A command takes {1e3 * found.loop:.1f} ms to the joint, {1e3 * abs(found.dead_time):.1f} ms "
        f"{'less' if found.dead_time < 0.0 else 'more'} than the cycle in which it is heard."
    )
    if found.camera is not None:
        verdict += f" A picture is {1e3 * found.camera:.1f} ms old when it arrives."
    write_plot_page(
        path,
        "Delays of a station",
        verdict,
        [
            Section(
                "The joint follows its command",
                "Both over the controller's own stamps; moved back by the loop, the joint lies on it.",
                moved,
            ),
            Section(
                "The clocks",
                "A line that rises or falls is a drift; steps would be a clock set anew.",
                clocks,
            ),
            Section(
                "Our own turn-around",
                "From a message in to its reply out; the few far right are what else the machine did.",
                spread,
                320,
            ),
        ],
    )

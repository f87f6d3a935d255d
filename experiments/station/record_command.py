"""``truetip record``: the measurement run on a station, configuration by configuration into a table."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from diagrams.hardware_link import EndedOnRequest
from diagrams.record.recorded_link import RecordedStation
from diagrams.runs.guided_measurement import GuidedMeasurement, Row, Visit
from diagrams.scenario.scenario import load_scenario
from experiments.cli.command_table import stays
from experiments.cli.console import BROKEN_OFF, count, print_files, progress_bar, refusing
from experiments.cli.ending import asking
from experiments.cli.json_output import human_console, json_output
from experiments.cli.options import JsonOption, ScenarioOption, SetOption, WithCellOption, YesOption
from experiments.cli.prepare import Prepared, prepare
from experiments.cli.staging import TABLE, check_suffix
from experiments.cli.workers import SimulationError
from experiments.station.clients import station_clients
from experiments.station.guided_command import ask_before_moving, check_measures_alone, on_station
from experiments.station.kept_record import kept_record, next_part
from experiments.station.measured_table import MeasuredTable, read_configurations
from robots.calibration.dwells import DwellRule
from robots.measurement_design.clear_ways import ClearWays
from robots.measurement_design.constraints import AdmissibleConfig, AdmissibleConfigurations
from robots.measurement_design.obstacles import read_obstacles
from systems.link.udp_channel import ChannelError


def record_command(
    design: Annotated[
        str,
        typer.Argument(metavar="DESIGN.csv", help="Where to measure: a table of truetip design --write."),
    ],
    out: Annotated[
        Path,
        typer.Option("--write", metavar="FILE.csv", help="The table; an interrupted run goes on in it."),
    ] = Path("out/measured.csv"),
    scenario: ScenarioOption = "cell",
    settings: SetOption = None,
    with_cell: WithCellOption = False,
    yes: YesOption = False,
    settle: Annotated[float, typer.Option(metavar="S", help="Rest before a measurement.")] = 0.5,
    mean: Annotated[float, typer.Option(metavar="S", help="Time over which it is averaged.")] = 1.0,
    speed: Annotated[
        float, typer.Option(metavar="SHARE", help="Of the largest joint speeds, on the ways.")
    ] = 0.3,
    obstacles: Annotated[
        str | None, typer.Option(metavar="FILE.yaml", help="Boxes that the arm keeps clear of.")
    ] = None,
    mcap: Annotated[
        str | None,
        typer.Option(
            "--write-recording", metavar="FILE.mcap", help="Also all that is said, for calibrate --recording."
        ),
    ] = None,
    json_file: JsonOption = None,
) -> None:
    """Measure a robot on its controller: visit configurations, rest and average."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError, ChannelError), output.staged():
        rule = DwellRule(settle, mean)
        check_suffix(out, TABLE)
        check_suffix(mcap or "all.mcap", (".mcap",))
        q = read_configurations(design)
        station = load_scenario(scenario, settings).station
        link = station.link
        check_measures_alone("record", station)
        name, changes = on_station(scenario, list(settings or []), link.kind, with_cell)
        prepared = prepare(name, changes, needs_path=False)
        run = GuidedMeasurement(prepared.scenario, prepared.robot, rule, speed)
        table = MeasuredTable(out, q, prepared.scenario.station.payload)
        boxes = read_obstacles(obstacles) if obstacles else ()
        config = AdmissibleConfig(obstacles=boxes)
        ways = ClearWays(prepared.robot, AdmissibleConfigurations(prepared.robot, config), config.clearance)
        visits = _visits(ways, q, table.measured)
        if table.measured:
            human.print(f"{out} has {len(table.measured)} of {len(q)} configurations; the others follow")
        ask_before_moving(human, prepared, with_cell or yes)
        stays(out)
        # What was said before stays, as what was measured does.
        part = Path(mcap) if mcap else None
        part = next_part(part) if part and table.measured else part
        try:
            unseen, ended, code = _recorded(prepared, run, (visits, ways), table, (with_cell, part))
        except SimulationError as error:
            if not table.measured:
                raise
            unseen, ended, code = [], str(error), BROKEN_OFF
        result = {
            "configurations": len(q),
            "measured": len(table.measured),
            "not_seen": unseen,
            "ended": ended,
            "file": str(out),
        }
        output.write(result)
    human.print(f"{count(len(table.measured), 'configuration')} of {len(q)} measured")
    if unseen:
        human.print(f"The camera saw too little at configurations {', '.join(map(str, unseen))}")
    print_files(human, out if table.measured else None, part)
    if ended != "design":
        typer.echo(f"truetip: {ended}; the same command goes on from here", err=True)
        raise typer.Exit(code)


def _visits(ways: ClearWays, q: np.ndarray, measured: set[int]) -> list[Visit]:
    """What is left to visit, on ways that are clear from the one before.

    Raises:
        ValueError: if there is no way to one.
    """
    left = [number for number in range(1, len(q) + 1) if number not in measured]
    if not left:
        return []
    places = q[np.array(left) - 1]
    vias = [np.zeros((0, q.shape[1])), *ways.through(places)]
    return [Visit(number, place, via) for number, place, via in zip(left, places, vias, strict=True)]


def _recorded(
    prepared: Prepared,
    run: GuidedMeasurement,
    route: tuple[Sequence[Visit], ClearWays],
    table: MeasuredTable,
    options: tuple[bool, Path | None],
) -> tuple[list[int], str, int]:
    """Runs what is left; gives what was not seen, why it ended and the exit code for that."""
    (visits, ways), (with_cell, mcap) = route, options
    if not visits:
        return [], "design", 0

    def keep(visit: Visit, row: Row) -> None:
        table.append(visit.number, row)

    with (
        ExitStack() as stack,
        asking() as end,
        station_clients(prepared.scenario, prepared.robot, with_cell, True) as station,
        progress_bar(f"measuring at {count(len(visits), 'configuration')}") as progress,
    ):
        client, camera = station.client, station.camera
        assert camera is not None
        if mcap:
            recorded = RecordedStation(client, camera, kept_record(stack, mcap, prepared.kept))
            client, camera = recorded.client, recorded.camera
        try:
            unseen = run.run(
                client,
                camera,
                visits,
                keep,
                progress,
                is_asked_to_end=end.is_asked,
                first_way=ways.between,
            )
        except EndedOnRequest:
            return [], "ended on request", end.code or BROKEN_OFF
    return unseen, "design", 0

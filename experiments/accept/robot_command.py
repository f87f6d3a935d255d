"""``truetip accept robot``: the test cycle of ISO 9283 with loads and speeds, and a table to print."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich import box
from rich.markup import escape
from rich.table import Table

from diagrams.record.log import RunLog
from diagrams.scenario.scenario import Scenario
from experiments.accept.on_station import guided_log
from experiments.accept.robot_cycle import (
    Cycle,
    cube_poses,
    path_results,
    path_scenario,
    pose_results,
    pose_scenario,
    visits,
)
from experiments.accept.robot_page import Row, table_rows, verdict, write_acceptance_page
from experiments.cli.console import print_files, print_note, print_table, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least, in_millimetres, positive
from experiments.cli.options import (
    AnyScenarioOption,
    JsonOption,
    LawOption,
    PictureOption,
    RobotOption,
    SetOption,
    StationOption,
    WithCellOption,
    YesOption,
)
from experiments.cli.prepare import Prepared, prepare, with_assumed
from experiments.cli.staging import PAGE, staged_file
from experiments.comparison.compare import RunJob, run_job
from experiments.report.style import law_title
from experiments.station.guided_command import ask_before_moving, check_measures_alone, on_station
from robots.dynamics.newton_inverse import inverse_kinematics
from systems.link.udp_channel import ChannelError


def accept_robot_command(
    scenario: AnyScenarioOption = None,
    settings: SetOption = None,
    robot: RobotOption = None,
    law: LawOption = None,
    cycles: Annotated[int, typer.Option(metavar="N", help="Cycles of poses and of the square.")] = 30,
    cube: Annotated[float, typer.Option(metavar="MM", help="Edge of the cube that is tested.")] = 250.0,
    loads: Annotated[
        str | None, typer.Option(metavar="KG,KG", help="Masses at the flange.", show_default="the scenario's")
    ] = None,
    speeds: Annotated[
        str, typer.Option(metavar="PERCENT,...", help="Shares of the speed of the moves.")
    ] = "100",
    dwell: Annotated[float, typer.Option(metavar="S", help="Time at rest at every pose.")] = 1.0,
    band: Annotated[
        float, typer.Option(metavar="MM", help="Distance within which a pose counts as stable.")
    ] = 0.1,
    station: StationOption = None,
    with_cell: WithCellOption = False,
    yes: YesOption = False,
    out: PictureOption = Path("out/accept-robot.html"),
    json_file: JsonOption = None,
) -> None:
    """Run the test cycle of ISO 9283 and print its table of poses, distances, path, corners and velocity.

    Errors are those of the true tip of a simulated station; on hardware they are what its camera measures.
    """
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError, ChannelError), ExitStack() as stack:
        at_least("--cycles", 2, cycles)
        in_millimetres("--cube", cube)
        for name, value in (("--dwell", dwell), ("--band", band)):
            positive(name, value)
        if dwell < 0.2:
            raise ValueError(f"--dwell must be at least 0.2 s, got {dwell:g}")
        name, changes = on_station(scenario, settings or [], station, with_cell)
        prepared = prepare(name, changes, robot)
        is_simulated = prepared.scenario.station.kind == "simulated"
        chosen = law or prepared.scenario.law
        masses = _numbers("--loads", loads, 0.0, 1000.0) or [prepared.scenario.station.payload]
        shares = _numbers("--speeds", speeds, 1.0, 100.0)
        cycle = Cycle(cube_poses(prepared.scenario, 1e-3 * cube), dwell, 1e-3 * band)
        _check_reach(prepared, cycle, cube)
        if not is_simulated:
            _refuse_on_station(prepared, masses)
            ask_before_moving(human, prepared, with_cell or yes)
        print_note(human, prepared.note)
        page = stack.enter_context(staged_file(out, *PAGE))
        stack.enter_context(output.staged())
        rows: list[Row] = []
        work = 2.0 * len(masses) * len(shares)
        with progress_bar(f"{cycles} cycles of poses and of the square") as progress:
            for mass in masses:
                for share in shares:
                    done = 2.0 * len(rows)
                    rows.append(
                        _row(prepared, chosen, cycle, cycles, mass, 0.01 * share, with_cell,
                             lambda x, done=done: progress((done + x) / work))
                    )  # fmt: skip
        title = f"ISO 9283, {prepared.robot.name}, {law_title(chosen)}"
        told = verdict(rows, law_title(chosen), cycles, cube)
        write_acceptance_page(page, title, told, prepared.title, rows)
        numbers = {"law": chosen, "cycles": cycles, "cube_mm": cube, "rows": [row.results for row in rows]}
        output.write(with_assumed(numbers, prepared.robot))
    shown = Table(title=escape(title), box=box.SIMPLE)
    for number, name in enumerate(("criterion", *(row.name for row in rows))):
        shown.add_column(name, justify="left" if number == 0 else "right")
    for line in table_rows(rows):
        shown.add_row(*line)
    print_table(human, shown)
    human.print(escape(told))
    print_files(human, out)


def _row(
    prepared: Prepared,
    law: str,
    cycle: Cycle,
    cycles: int,
    mass: float,
    speed: float,
    with_cell: bool,
    progress: Callable[[float], None],
) -> Row:
    scenario = prepared.scenario
    scenario = replace(scenario, station=replace(scenario.station, payload=mass))
    poses, square = (make(scenario, cycle, cycles, speed) for make in (pose_scenario, path_scenario))

    def ran(scenario: Scenario, progress: Callable[[float], None]) -> RunLog:
        if scenario.station.kind == "simulated":
            return run_job(RunJob(scenario, prepared.robot, law, scenario.seed), progress)
        return guided_log(scenario, prepared.robot, law, with_cell, progress)

    visited = ran(poses, progress)
    run = ran(square, lambda x: progress(1.0 + x))
    found, along = visits(visited, poses, cycle, cycles), path_results(run, square, cycle)
    return Row(mass, 100.0 * speed, pose_results(found, cycle) | along.results, found, along)


def _refuse_on_station(prepared: Prepared, masses: list[float]) -> None:
    """Refuses what a station of hardware cannot do. Raises ValueError."""
    station = prepared.scenario.station
    if masses != [station.payload]:
        raise ValueError("--loads is of a simulated station: set station.payload, and run it for each load")
    check_measures_alone("accept robot", station)


def _check_reach(prepared: Prepared, cycle: Cycle, cube: float) -> None:
    """Raises ValueError if the robot cannot reach a pose: sooner, and in other words, than a run does."""
    solver, near = inverse_kinematics(prepared.robot), np.deg2rad(prepared.scenario.home_deg)
    for number, X in enumerate(cycle.poses, 1):
        try:
            solver.nearest(X, near)
        except ValueError as error:
            raise ValueError(f"--cube {cube:g}: P{number} of the cube cannot be reached: {error}") from error


def _numbers(option: str, text: str | None, low: float, high: float) -> list[float]:
    """Numbers that an option lists. Raises ValueError if one is none or out of its range."""
    found = []
    for part in filter(None, (text or "").split(",")):
        try:
            value = float(part)
        except ValueError:
            raise ValueError(f"{option} must be numbers such as 0,7, got '{part}'") from None
        if not low <= value <= high:
            raise ValueError(f"{option} must be between {low:g} and {high:g}, got {part}")
        found.append(value)
    if text is not None and not found:
        raise ValueError(f"{option} must be numbers such as 0,7, got '{text}'")
    return found

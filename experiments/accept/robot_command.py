"""``truetip accept robot``: the test cycle of ISO 9283 with loads and speeds, and a table to print."""

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.markup import escape
from rich.table import Table

from experiments.accept.robot_cycle import (
    Cycle,
    cube_poses,
    path_results,
    path_scenario,
    pose_results,
    pose_scenario,
)
from experiments.cli.console import print_files, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least, positive
from experiments.cli.options import JsonOption, OnlyPictureOption, RobotOption, ScenarioOption, SetOption
from experiments.cli.prepare import Prepared, prepare, simulated_only
from experiments.cli.staging import PAGE, staged_file
from experiments.comparison.compare import RunJob, run_job
from experiments.report.plot_page import Section, html_table, write_plot_page

TITLES = {
    "AP_mm": "pose accuracy AP in mm",
    "RP_mm": "pose repeatability RP in mm",
    "AP_deg": "pose accuracy, orientation, in degrees",
    "vAP_mm": "multi-directional pose accuracy variation vAP in mm",
    "AD_mm": "distance accuracy AD, P2 to P4, in mm",
    "RD_mm": "distance repeatability RD in mm",
    "dAP_mm": "drift of pose accuracy dAP over the cycles in mm",
    "stabilisation_s": "pose stabilisation time in s",
    "overshoot_mm": "pose overshoot in mm",
    "AT_mm": "path accuracy AT in mm",
    "RT_mm": "path repeatability RT in mm",
    "AT_deg": "path accuracy, orientation, in degrees",
    "CR_mm": "corner rounding CR in mm",
    "CO_mm": "corner overshoot CO in mm",
    "AV_percent": "path velocity accuracy AV in percent",
    "RV_percent": "path velocity repeatability RV in percent",
}
_NOTE = (
    "The largest over the poses or along the square P2, P3, P4, P5. The speed of a path rises and falls "
    "between corners; velocity is compared at its peak. Drift is between the first and the last quarter of "
    "the cycles, not over the eight hours of the standard."
)


def accept_robot_command(
    scenario: ScenarioOption = "misaligned",
    settings: SetOption = None,
    robot: RobotOption = None,
    law: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which law.", show_default="the scenario's")
    ] = None,
    cycles: Annotated[int, typer.Option(metavar="N", help="Cycles of poses and of the square.")] = 30,
    cube: Annotated[float, typer.Option(metavar="MM", help="Edge of the cube.")] = 250.0,
    loads: Annotated[
        str | None, typer.Option(metavar="KG,KG", help="Masses at the flange.", show_default="the scenario's")
    ] = None,
    speeds: Annotated[
        str, typer.Option(metavar="PERCENT,...", help="Shares of the speed of the moves.")
    ] = "100",
    dwell: Annotated[float, typer.Option(metavar="S", help="At rest at every pose.")] = 1.0,
    band: Annotated[float, typer.Option(metavar="MM", help="Within which a pose counts as stable.")] = 0.1,
    out: OnlyPictureOption = Path("out/accept-robot.html"),
    json_file: JsonOption = None,
) -> None:
    """Run the test cycle of ISO 9283 and print its table of poses, distances, path, corners and velocity."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        at_least("--cycles", 2, cycles)
        for name, value in (("--cube", cube), ("--dwell", dwell), ("--band", band)):
            positive(name, value)
        if dwell < 0.2:
            raise ValueError(f"--dwell must be at least 0.2 s, got {dwell:g}")
        prepared = prepare(scenario, settings or [], robot)
        simulated_only(prepared, "accept robot", "leave out --station")
        chosen = law or prepared.scenario.law
        masses = _numbers("--loads", loads, 0.0, 1000.0) or [prepared.scenario.station.payload]
        shares = _numbers("--speeds", speeds, 1.0, 100.0)
        cycle = Cycle(cube_poses(prepared.scenario, 1e-3 * cube), dwell, 1e-3 * band)
        page = stack.enter_context(staged_file(out, *PAGE))
        stack.enter_context(output.staged())
        rows, work = [], 2.0 * len(masses) * len(shares)
        with progress_bar(f"{cycles} cycles of poses and of the square") as progress:
            for mass in masses:
                for share in shares:
                    done = 2.0 * len(rows)
                    rows.append(
                        _row(prepared, chosen, cycle, cycles, mass, 0.01 * share,
                             lambda x, done=done: progress((done + x) / work))
                    )  # fmt: skip
        table = _table_rows(rows)
        head = ("criterion", *(f"{row['load_kg']:g} kg, {row['speed_percent']:g} %" for row in rows))
        title = f"ISO 9283, {prepared.robot.name}, {chosen}, {cycles} cycles, cube of {cube:g} mm"
        write_plot_page(page, title, _NOTE, [Section("Results", prepared.title, html_table(head, table))])
        output.write({"law": chosen, "cycles": cycles, "cube_mm": cube, "rows": rows})
    shown = Table(title=escape(title), box=box.SIMPLE)
    for number, name in enumerate(head):
        shown.add_column(name, justify="left" if number == 0 else "right")
    for row in table:
        shown.add_row(*row)
    human.print(shown)
    print_files(human, out)


def _row(
    prepared: Prepared, law: str, cycle: Cycle, cycles: int, mass: float, speed: float, progress: Any
) -> dict[str, Any]:
    scenario = prepared.scenario
    scenario = replace(scenario, station=replace(scenario.station, payload=mass))
    poses, square = (make(scenario, cycle, cycles, speed) for make in (pose_scenario, path_scenario))
    visited = run_job(RunJob(poses, prepared.robot, law, scenario.seed), progress)
    run = run_job(RunJob(square, prepared.robot, law, scenario.seed), lambda x: progress(1.0 + x))
    return {
        "load_kg": mass,
        "speed_percent": 100.0 * speed,
        **pose_results(visited, poses, cycle, cycles),
        **path_results(run, square, cycle),
    }


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


def _table_rows(rows: list[dict[str, Any]]) -> list[list[str]]:
    return [
        [title, *("-" if row[name] is None else f"{row[name]:.3f}" for row in rows)]
        for name, title in TITLES.items()
    ]

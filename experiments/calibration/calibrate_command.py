"""``truetip calibrate``: measure, identify, validate, and write the robot as it is."""

import sys
import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from diagrams.log import RunLog
from diagrams.scenario import Scenario
from experiments.calibration.calibrate import (
    NOISES,
    VALIDATION_COUNT,
    CalibrationStudy,
    MeasuredSets,
    identification_config,
    measure_sets,
    path_runs,
    true_base_parameters,
    validated,
    validation_configurations,
)
from experiments.calibration.report import calibration_json, print_calibration, write_calibration_page
from experiments.comparison.metrics import json_text, summary
from experiments.report.files import write_text
from experiments.terminal.console import progress_bar, refusing
from experiments.terminal.options import OutOption, RobotOption, ScenarioOption, SetOption
from experiments.terminal.prepare import check, prepare
from experiments.terminal.staging import staged_file, staged_folder
from robots.calibration.admissible import AdmissibleConfigurations
from robots.calibration.criteria import NAMES
from robots.calibration.design import MeasurementDesign, design_measurements
from robots.calibration.identification import identify
from robots.calibration.measurement_file import RowProblem, measurement_text, read_measurements
from robots.model import RobotModel
from robots.robot_file import robot_text
from robots.urdf import urdf_text


def calibrate_command(
    scenario: ScenarioOption = "misaligned",
    settings: SetOption = None,
    robot: RobotOption = None,
    measurements: Annotated[
        str | None,
        typer.Option(metavar="FILE.csv", help="Identify from this table instead of simulated measurements."),
    ] = None,
    validation: Annotated[
        str | None, typer.Option(metavar="FILE.csv", help="Validate with this table; needs --measurements.")
    ] = None,
    count: Annotated[int, typer.Option(metavar="N", help="Configurations to identify from.")] = 75,
    criterion: Annotated[
        str, typer.Option(metavar="NAME", help=f"Of their choice, one of {', '.join(NAMES)}.")
    ] = "b3",
    noise: Annotated[
        str,
        typer.Option(metavar="NAME", help="On every row: none, or source for that of Probst's table 6.1."),
    ] = "none",
    position_only: Annotated[
        bool, typer.Option("--position-only", help="Use positions of the tool only, no orientations.")
    ] = False,
    compliance: Annotated[
        bool,
        typer.Option("--compliance", help="Identify how far the joints yield; measures with two payloads."),
    ] = False,
    fixed: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="A parameter that stays zero; repeatable.")
    ] = None,
    write: Annotated[
        str | None,
        typer.Option(metavar="FILE.yaml", help="The calibrated robot, for --robot of other commands."),
    ] = None,
    urdf: Annotated[str | None, typer.Option(metavar="FILE.urdf", help="The same as URDF.")] = None,
    out: OutOption = Path("out/calibration"),
    json_file: Annotated[
        str | None,
        typer.Option("--json", metavar="FILE", help="The numbers; - prints them, and nothing else."),
    ] = None,
) -> None:
    """Find the true geometry of a robot and what it is worth on the path."""
    human = Console(stderr=json_file == "-")
    problems: list[tuple[str, RowProblem]] = []
    with refusing(ValueError, OSError), ExitStack() as stack:
        if validation and not measurements:
            raise ValueError("--validation needs --measurements; without it both sets are simulated")
        if noise not in NOISES:
            raise ValueError(f"--noise must be one of {', '.join(NOISES)}, got '{noise}'")
        if count < 5:
            raise ValueError(f"--count must be at least 5, got {count}")
        prepared = prepare(scenario, settings or [], robot)
        check(prepared, ["open_loop"])
        stage = stack.enter_context(staged_folder(out))
        files = {
            name: stack.enter_context(staged_file(name))
            for name in (write, urdf, json_file)
            if name and name != "-"
        }
        if measurements:
            sets, problems = _read(measurements, validation)
            design, design_seconds = None, 0.0
        else:
            design, design_seconds, sets = _simulated(
                prepared.scenario, prepared.robot, count, criterion, noise, position_only, compliance
            )
        table = sets.calibration.without_rotation() if position_only else sets.calibration
        config = identification_config(compliance, fixed or [], NOISES[noise])
        identified = identify(prepared.robot, table, config)
        calibrated = identified.calibrated_robot(prepared.scenario.robot)
        rigid = None
        if compliance:
            rigid = identify(prepared.robot, table, replace(config, compliance=False)).calibrated_robot()
        study = CalibrationStudy(
            nominal=prepared.robot,
            calibrated=calibrated,
            design=design,
            design_seconds=design_seconds,
            sets=sets,
            identified=identified,
            truth=None
            if measurements
            else true_base_parameters(prepared.scenario, prepared.robot, position_only),
            before=validated(prepared.robot, sets.validation, position_only),
            after=validated(calibrated, sets.validation, position_only),
            geometry_only=validated(rigid, sets.validation, position_only) if rigid else None,
            after_noise_free=validated(calibrated, sets.validation_truth, position_only),
        )
        path = None if measurements else _path(prepared.scenario, prepared.robot, calibrated)
        result = calibration_json(study, path)
        _write_tables(stage, sets)
        write_calibration_page(stage / "report.html", prepared.title, study, path, problems)
        if write:
            write_text(files[write], robot_text(calibrated))
        if urdf:
            write_text(files[urdf], urdf_text(calibrated))
        if json_file and json_file != "-":
            write_text(files[json_file], json_text(result))
    if json_file == "-":
        sys.stdout.write(json_text(result))
    print_calibration(human, study, path, problems)
    for name in (str(out / "report.html"), write, urdf):
        if name:
            human.print(escape(name), soft_wrap=True)


def _read(measurements: str, validation: str | None) -> tuple[MeasuredSets, list[tuple[str, RowProblem]]]:
    problems: list[tuple[str, RowProblem]] = []
    tables = []
    for name in filter(None, (measurements, validation)):
        table, found = read_measurements(name)
        tables.append(table)
        problems += [(name, problem) for problem in found]
    return MeasuredSets(tables[0], tables[1] if validation else None, None), problems


def _simulated(
    scenario: Scenario,
    robot: RobotModel,
    count: int,
    criterion: str,
    noise: str,
    position_only: bool,
    compliance: bool,
) -> tuple[MeasurementDesign, float, MeasuredSets]:
    """Design and measurements of a simulated calibration."""
    started = time.perf_counter()
    with progress_bar(f"choosing {count} configurations") as progress:
        design = design_measurements(
            robot,
            count,
            criterion,
            position_only,
            admissible=AdmissibleConfigurations(robot),
            seed=scenario.seed,
            progress=progress,
        )
    seconds = time.perf_counter() - started
    fresh = validation_configurations(robot, VALIDATION_COUNT, scenario.seed)
    payload = scenario.station.payload
    payloads = [payload, 0.0 if payload > 0.0 else robot.payload.largest_mass] if compliance else [payload]
    with progress_bar(f"measuring {len(payloads) * count + len(fresh)} poses") as progress:
        sets = measure_sets(
            scenario, design.configurations, fresh, payloads, NOISES[noise], progress=progress
        )
    return design, seconds, sets


def _path(scenario: Scenario, nominal: RobotModel, calibrated: RobotModel) -> dict[str, Any]:
    """Logs and true errors of the path, before and after."""
    with progress_bar("the path before and after") as progress:
        logs: dict[str, RunLog] = path_runs(scenario, nominal, calibrated, progress=progress)
    runs = summary("", {name: [log] for name, log in logs.items()})["runs"]
    return {name: {"log": logs[name], "errors": runs[name]["true"]} for name in logs}


def _write_tables(stage: Path, sets: MeasuredSets) -> None:
    write_text(stage / "measurements.csv", measurement_text(sets.calibration))
    if sets.validation is not None:
        write_text(stage / "validation.csv", measurement_text(sets.validation))

"""``truetip calibrate`` from tables of several targets and instruments."""

from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.markup import escape

from experiments.calibration.calibrate import refuse_the_harmful, validating
from experiments.calibration.instruments_report import (
    instruments_json,
    sentence,
    validation_sentence,
    write_instruments_page,
)
from experiments.calibration.report import problem_lines
from experiments.calibration.urdf_option import Sag, urdf_robot
from experiments.cli.console import print_files
from experiments.cli.json_output import JsonOutput
from experiments.cli.staging import YAML, staged_file, staged_folder
from experiments.report.files import write_text
from robots.calibration.instruments.cell_file import read_cell
from robots.calibration.instruments.identify import InstrumentCalibration, identify_with_instruments
from robots.calibration.instruments.observation_file import read_observations
from robots.calibration.instruments.observations import MeasuringCell, Observations
from robots.calibration.instruments.validation import FreshLines, validate_lines
from robots.calibration.measurement_file import RowProblem
from robots.calibration.measurements import MeasurementNoise
from robots.description.model import RobotModel
from robots.description.robot_file import robot_text
from robots.description.urdf import urdf_text


@dataclass(frozen=True)
class InstrumentTables:
    """What was measured and is known, and what is to be found."""

    measurements: str  # file
    cell: str | None  # file of what is known before
    validation: str | None  # file of lines that are not used
    noise: MeasurementNoise  # of what neither the lines nor the cell say
    fixed: tuple[str, ...] = ()
    joint_errors: tuple[str, ...] = ()
    compliance: bool = False


@dataclass(frozen=True)
class ResultFiles:
    """Where the results go."""

    out: Path  # folder of the report
    robot: str | None = None
    urdf: str | None = None
    sag: Sag | None = None  # what is baked into the URDF


def calibrate_with_instruments(
    console: Console,
    output: JsonOutput,
    robot: tuple[str, RobotModel],
    tables: InstrumentTables,
    files: ResultFiles,
) -> None:
    """Reads, adjusts and writes.

    Args:
        console: for people.
        output: takes the numbers.
        robot: name and nominal model.
        tables: the files that were given, and what to identify.
        files: those to be written.

    Raises:
        ValueError: if a file cannot be used or the adjustment fails.
        OSError: if a result cannot be written.
    """
    name, nominal = robot
    seen, problems = read_observations(tables.measurements)
    unused = [(tables.measurements, problem) for problem in problems]
    fresh = None
    if tables.validation:
        fresh, problems = read_observations(tables.validation)
        unused += [(tables.validation, problem) for problem in problems]
    cell, note = _cell(tables, seen), ""
    with ExitStack() as stack:
        stage = stack.enter_context(staged_folder(files.out, "report.html"))
        robot_file = stack.enter_context(staged_file(files.robot, *YAML)) if files.robot else None
        urdf_file = stack.enter_context(staged_file(files.urdf, ".urdf", ".xml")) if files.urdf else None
        stack.enter_context(output.staged())
        found = identify_with_instruments(
            nominal, seen, cell, tables.joint_errors, tables.compliance, tables.fixed
        )
        with validating(tables.validation):
            checked = validate_lines(found, fresh) if fresh else None
            if checked:
                refuse_the_harmful(*(1e3 * float(np.mean(each)) for each in checked.distances()))
        calibrated = found.calibrated_robot(name)
        output.write(instruments_json(found, tables.measurements, unused, checked))
        write_instruments_page(stage / "report.html", found, checked)
        if robot_file and files.robot:
            write_text(robot_file, robot_text(calibrated, beside=Path(files.robot)))
        if urdf_file:
            drawn, note = urdf_robot(calibrated, files.sag, seen.q, seen.loads)
            write_text(urdf_file, urdf_text(drawn, note))
    _print(console, found, checked, unused)
    if note:
        console.print(f"[yellow]{escape(note)}[/yellow]")
    print_files(console, files.out / "report.html", files.robot, files.urdf)


def _cell(tables: InstrumentTables, seen: Observations) -> MeasuringCell:
    """What is known before, the noise included. Raises ValueError for names that no line has in that role."""
    cell = read_cell(tables.cell) if tables.cell else MeasuringCell({}, {}, {}, {})
    bars = [name for i, name in enumerate(seen.instruments) if seen.is_bar(i)]
    others = [name for name in seen.instruments if name not in bars]
    for key, labels, kind, known in (
        ("targets", cell.places, "a target", seen.targets),
        ("frames", cell.frames, "an instrument of coordinates", others),
        ("anchors", cell.anchors, "an instrument of distances", bars),
        ("sigma_mm", cell.sigmas, "an instrument", seen.instruments),
    ):
        for label in labels:
            if label not in known:
                raise ValueError(
                    f"cell {tables.cell}: {key}.{label}: no line is of {kind} {label}; there are "
                    f"{', '.join(sorted(known)) or 'none'}"
                )
    if not tables.noise.is_known:
        return cell
    said = dict.fromkeys(seen.instruments, tables.noise.position_sigma) | cell.sigmas
    joint = tables.noise.joint_sigma if cell.joint_sigma is None else cell.joint_sigma
    return replace(cell, sigmas=said, joint_sigma=joint)


def _print(
    console: Console,
    found: InstrumentCalibration,
    checked: FreshLines | None,
    unused: list[tuple[str, RowProblem]],
) -> None:
    console.print(escape(sentence(found)))
    if checked:
        console.print(escape(validation_sentence(checked)))
    for line in problem_lines(unused):
        console.print(f"[yellow]{escape(line)}[/yellow]")
    for what, lines in (
        ("left out", found.outliers),
        ("left out of the validation", checked.outliers if checked else ()),
    ):
        if lines:
            console.print(f"[yellow]Gross errors, {what}: lines {', '.join(map(str, lines))}[/yellow]")
    console.print()

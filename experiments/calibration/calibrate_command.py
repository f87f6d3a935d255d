"""``truetip calibrate``: measure, identify, validate, and write the robot as it is."""

import time
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from diagrams.record.log import RunLog
from diagrams.scenario.scenario import Scenario
from experiments.calibration.calibrate import (
    VALIDATION_COUNT,
    CalibrationStudy,
    MeasuredSets,
    identification_config,
    measure_sets,
    path_runs,
    true_values,
    validate,
    validated,
    validating,
    validation_configurations,
)
from experiments.calibration.instruments import InstrumentTables, ResultFiles, calibrate_with_instruments
from experiments.calibration.noise_option import ESTIMATE, noise_option
from experiments.calibration.page import write_calibration_page
from experiments.calibration.recording import recorded_measurements
from experiments.calibration.report import calibration_json, print_calibration
from experiments.calibration.urdf_option import urdf_robot, urdf_sag
from experiments.cli.console import print_files, print_note, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least, one_of
from experiments.cli.options import JsonOption, OutOption, RobotOption, ScenarioOption, SetOption
from experiments.cli.prepare import Prepared, check, prepare, simulated_only
from experiments.cli.staging import YAML, staged_file, staged_folder
from experiments.metrics.run_metrics import summary
from experiments.report.files import write_text
from robots.calibration.identification import identify
from robots.calibration.instruments.observation_file import names_targets
from robots.calibration.measurement_file import RowProblem, measurement_text, read_measurements
from robots.description.joint_errors import names_of
from robots.description.robot_file import robot_text
from robots.description.source_notes import foreign_sources_note
from robots.description.urdf import urdf_text
from robots.measurement_design.constraints import AdmissibleConfigurations
from robots.measurement_design.criteria import NAMES
from robots.measurement_design.design import MeasurementDesign, design_measurements

_COUNT, _CRITERION = 75, "b3"  # of a simulated calibration
_TABLES = ("measurements.csv", "validation.csv")
_RESULTS = ("report.html", *_TABLES)  # in the folder of --out


def calibrate_command(
    scenario: ScenarioOption = "misaligned",
    settings: SetOption = None,
    robot: RobotOption = None,
    measurements: Annotated[
        str | None,
        typer.Option(metavar="FILE.csv", help="Identify from this table instead of simulated measurements."),
    ] = None,
    recording: Annotated[
        str | None,
        typer.Option(
            metavar="FILE.mcap",
            help="Identify from the dwells of a recorded motion: 0.5 s to settle, the mean of 1 s.",
        ),
    ] = None,
    validation: Annotated[
        str | None, typer.Option(metavar="FILE.csv", help="Validate with this table; needs measurements.")
    ] = None,
    count: Annotated[
        int | None, typer.Option(metavar="N", help="Configurations to simulate.", show_default="75")
    ] = None,
    criterion: Annotated[
        str | None,
        typer.Option(metavar="NAME", help=f"Of their choice, one of {', '.join(NAMES)}.", show_default="b3"),
    ] = None,
    noise: Annotated[
        str,
        typer.Option(
            metavar="FILE|source|estimate",
            help="What is known of the noise: a YAML file with joint_deg, position_mm and, for poses, "
            "rotation_deg, or source for Probst's table 6.1; estimate for nothing. A simulation adds it to "
            "every row.",
        ),
    ] = ESTIMATE,
    position_only: Annotated[
        bool, typer.Option("--position-only", help="Use positions of the tool only, no orientations.")
    ] = False,
    compliance: Annotated[
        bool | None,
        typer.Option(
            "--compliance/--no-compliance",
            help="Also identify joint compliances; measures with two payloads.",
            show_default="where a simulated robot's structure is elastic",
        ),
    ] = None,
    joint_errors: Annotated[
        str,
        typer.Option(
            metavar="A,B,...",
            help="Also identify errors that depend on joint angles: scale (of encoders), eccentricity (once "
            "per turn), motor and strain_wave (once and twice per turn of the motor), coupling (in a wrist).",
        ),
    ] = "",
    fixed: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="A parameter that stays zero; repeatable.")
    ] = None,
    write: Annotated[
        str | None,
        typer.Option(metavar="FILE.yaml", help="The calibrated robot, for --robot of other commands."),
    ] = None,
    urdf: Annotated[
        str | None, typer.Option(metavar="FILE.urdf", help="The calibrated robot as URDF.")
    ] = None,
    urdf_payload: Annotated[
        float | None,
        typer.Option(metavar="KG", help="Bake into the URDF how far the joints yield under this load."),
    ] = None,
    urdf_pose: Annotated[
        str | None,
        typer.Option(
            metavar="Q1,...,Q6", help="Joint positions in degrees for that.", show_default="all zero"
        ),
    ] = None,
    cell: Annotated[
        str | None,
        typer.Option(
            "--instruments",
            metavar="FILE.yaml",
            help="What is known of targets and instruments, for a table with a column target or instrument.",
        ),
    ] = None,
    out: OutOption = Path("out/calibration"),
    json_file: JsonOption = None,
) -> None:
    """Identify the geometry of a robot and validate it on the path."""
    human = human_console(json_file)
    wanted = _Wanted(
        measurements,
        validation,
        count,
        criterion,
        noise,
        position_only,
        compliance is True,
        fixed or [],
        tuple(filter(None, joint_errors.split(","))),
        recording,
    )
    note = ""
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        wanted.check()
        wanted.check_settings(settings or [])
        prepared = prepare(scenario, settings or [], robot, needs_path=not wanted.is_given)
        if compliance is None and not wanted.is_given:
            wanted = replace(wanted, compliance=prepared.scenario.station.elasticity == "structure")
        _refuse_onto_nominal(write, prepared.scenario.robot)
        print_note(human, foreign_sources_note(prepared.robot) if wanted.is_given else prepared.note)
        baked = urdf_sag(urdf, urdf_payload, urdf_pose, wanted.compliance)
        wanted.check_validation()
        if measurements and names_targets(measurements):
            wanted.check_instruments()
            adjusted = InstrumentTables(
                measurements,
                cell,
                validation,
                noise_option(noise, has_rotation=False),
                tuple(wanted.fixed),
                wanted.joint_errors,
                wanted.compliance,
            )
            files = ResultFiles(out, write, urdf, baked)
            calibrate_with_instruments(
                human, output, (prepared.scenario.robot, prepared.robot), adjusted, files
            )
            return
        if cell is not None:
            raise ValueError("--instruments is for a table with a column target, instrument or distance")
        if not wanted.is_given:  # of tables nothing but the kinematics is asked
            measure = "measure there (truetip design --program) and give the table with --measurements"
            simulated_only(prepared, "calibrate", measure)
            check(prepared, ["open_loop"])
        stage = stack.enter_context(staged_folder(out, *_RESULTS))
        robot_file = stack.enter_context(staged_file(write, *YAML)) if write else None
        urdf_file = stack.enter_context(staged_file(urdf, ".urdf", ".xml")) if urdf else None
        stack.enter_context(output.staged())
        measured = _read(prepared, wanted) if wanted.is_given else _simulated(prepared, wanted)
        study = _study(prepared, wanted, measured)
        path = None if wanted.is_given else _path(prepared.scenario, study)
        output.write(calibration_json(study, path, measured.problems))
        _write_tables(stage, measured.sets)
        title = prepared.robot.name if wanted.is_given else prepared.title  # tables have no scenario
        write_calibration_page(stage / "report.html", title, study, path, measured.problems)
        if robot_file and write:
            write_text(robot_file, robot_text(study.calibrated, beside=Path(write)))
        if urdf_file:
            table = study.sets.calibration
            drawn, note = urdf_robot(study.calibrated, baked, table.q, table.payload)
            write_text(urdf_file, urdf_text(drawn, note))
    print_calibration(human, study, path, measured.problems)
    if note:
        human.print(f"[yellow]{escape(note)}[/yellow]")
    print_files(human, out / "report.html", write, urdf)


@dataclass(frozen=True)
class _Wanted:
    """What to measure and to identify."""

    measurements: str | None
    validation: str | None
    count: int | None
    criterion: str | None
    noise: str
    position_only: bool
    compliance: bool
    fixed: list[str]
    joint_errors: tuple[str, ...]
    recording: str | None = None

    @property
    def is_given(self) -> bool:
        """Whether somebody has measured already."""
        return bool(self.measurements or self.recording)

    def check(self) -> None:
        """Raises ValueError if something is unknown, too small or does not go together."""
        if self.measurements and self.recording:
            raise ValueError("--measurements and --recording: one of them is the calibration set")
        if self.validation and not self.is_given:
            raise ValueError("--validation needs --measurements; without it both sets are simulated")
        if self.is_given:
            for option, value in (("--count", self.count), ("--criterion", self.criterion)):
                if value is not None:
                    raise ValueError(
                        f"{option} is for simulated measurements; with {self._source} it has no effect"
                    )
        one_of("--criterion", NAMES, self.criterion)
        at_least("--count", 5, self.count)
        noise_option(self.noise, has_rotation=False)  # what was measured is not known yet
        names_of(self.joint_errors)

    def check_settings(self, settings: list[str]) -> None:
        """Raises ValueError if a setting has no effect: what was measured depends on no scenario."""
        for setting in settings if self.is_given else []:
            if setting.partition("=")[0].strip() != "robot":
                raise ValueError(f"--set {setting} has no effect with {self._source}; --set robot=... has")

    @property
    def _source(self) -> str:
        return "--measurements" if self.measurements else "--recording"

    def check_validation(self) -> None:
        """Raises ValueError if fresh rows are of another kind than those that identify."""
        if not self.validation:
            return
        kinds = ("poses or positions", "targets and instruments")
        of_targets = bool(self.measurements) and names_targets(self.measurements or "")
        fresh_of_targets = names_targets(self.validation)
        if fresh_of_targets != of_targets:
            raise ValueError(
                f"--validation {self.validation}: a table of {kinds[fresh_of_targets]}, and the calibration "
                f"is from {kinds[of_targets]}; both need the same columns"
            )

    def check_instruments(self) -> None:
        """Raises ValueError if an option has no effect on tables of targets and instruments."""
        if self.position_only:
            raise ValueError("--position-only has no effect on a table of targets and instruments")


@dataclass(frozen=True)
class _Measured:
    """What there is to identify from and to validate with."""

    sets: MeasuredSets
    problems: list[tuple[str, RowProblem]] = field(default_factory=list)  # rows left out, by their files
    design: MeasurementDesign | None = None  # only where it was simulated
    design_seconds: float = 0.0


def _read(prepared: Prepared, wanted: _Wanted) -> _Measured:
    """The tables that were given, or the dwells of a recording."""
    problems: list[tuple[str, RowProblem]] = []
    tables = [recorded_measurements(wanted.recording, prepared.robot)] if wanted.recording else []
    for name in filter(None, (wanted.measurements, wanted.validation)):
        table, found = read_measurements(name)
        tables.append(table)
        problems += [(name, problem) for problem in found]
    return _Measured(MeasuredSets(tables[0], tables[1] if wanted.validation else None, None), problems)


def _simulated(prepared: Prepared, wanted: _Wanted) -> _Measured:
    """Design and measurements of a simulated calibration."""
    scenario, robot, count = prepared.scenario, prepared.robot, wanted.count or _COUNT
    noise = noise_option(wanted.noise, not wanted.position_only)
    started = time.perf_counter()
    with progress_bar(f"choosing {count} configurations") as progress:
        design = design_measurements(
            robot,
            count,
            wanted.criterion or _CRITERION,
            wanted.position_only,
            admissible=AdmissibleConfigurations(robot),
            seed=scenario.seed,
            progress=progress,
        )
    seconds = time.perf_counter() - started
    fresh = validation_configurations(robot, VALIDATION_COUNT, scenario.seed)
    payloads = [scenario.station.payload]
    if wanted.compliance:  # how far joints yield shows between two loads
        payloads.append(0.0 if payloads[0] > 0.0 else robot.payload.largest_mass)
    with progress_bar(f"measuring {len(payloads) * count + len(fresh)} poses") as progress:
        sets = measure_sets(scenario, design.configurations, fresh, payloads, noise, progress=progress)
    return _Measured(sets, design=design, design_seconds=seconds)


def _study(prepared: Prepared, wanted: _Wanted, measured: _Measured) -> CalibrationStudy:
    """Identifies the robot and validates it."""
    robot, sets = prepared.robot, measured.sets
    table = sets.calibration.without_rotation() if wanted.position_only else sets.calibration
    position_only = table.rotation is None
    noise = noise_option(wanted.noise, not position_only)
    config = identification_config(wanted.compliance, wanted.fixed, noise, wanted.joint_errors)
    identified = identify(robot, table, config)
    calibrated = identified.calibrated_robot(prepared.scenario.robot)
    rigid = None
    if wanted.compliance:
        rigid = identify(robot, table, replace(config, compliance=False)).calibrated_robot()
    is_simulated = measured.design is not None
    with validating(wanted.validation):
        checked = validate(identified, calibrated, sets.validation)
    return CalibrationStudy(
        nominal=identified.robot,
        calibrated=calibrated,
        design=measured.design,
        design_seconds=measured.design_seconds,
        sets=replace(sets, validation=checked.measurements),
        identified=identified,
        truth=true_values(prepared.scenario, robot, identified) if is_simulated else None,
        before=checked.before,
        after=checked.after,
        geometry_only=validated(rigid, checked.measurements, position_only) if rigid else None,
        after_noise_free=validated(calibrated, sets.validation_truth, position_only),
        validation_outliers=checked.left_out,
    )


def _path(scenario: Scenario, study: CalibrationStudy) -> dict[str, Any]:
    """Logs and true errors of the path, before and after."""
    with progress_bar("the path before and after") as progress:
        logs: dict[str, RunLog] = path_runs(scenario, study.nominal, study.calibrated, progress=progress)
    runs = summary("", {name: [log] for name, log in logs.items()})["runs"]
    return {name: {"log": logs[name], "errors": runs[name]["true"]} for name in logs}


def _write_tables(stage: Path, sets: MeasuredSets) -> None:
    for name, table in zip(_TABLES, (sets.calibration, sets.validation), strict=True):
        if table is not None:
            write_text(stage / name, measurement_text(table))


def _refuse_onto_nominal(write: str | None, robot: str) -> None:
    """Raises ValueError if the calibrated robot would replace the one that it is the calibration of."""
    if write and Path(write).resolve() == Path(robot).resolve():
        raise ValueError(f"--write {write} is the nominal robot; the calibrated one needs a file of its own")

"""``truetip cameras``: calibrate the cameras of a cell, and study what limits accuracy."""

import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from experiments.cameras.body_command import body_command
from experiments.cameras.budget_command import budget_command
from experiments.cameras.calibration import (
    CamerasFound,
    calibration_json,
    print_calibration,
    write_calibration_page,
)
from experiments.cameras.laws import study_laws
from experiments.cameras.report import print_study, write_study_page
from experiments.cameras.study import CamerasStudy, covariances, study_json, study_setup
from experiments.cameras.sweeps import study_sweeps
from experiments.cli.cluster import executor
from experiments.cli.command_app import command_app
from experiments.cli.console import print_files, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least, in_millimetres, positive, without_effect
from experiments.cli.options import (
    JobsOption,
    JsonOption,
    PictureOption,
    ScenarioOption,
    SchedulerOption,
    SetOption,
)
from experiments.cli.prepare import prepare
from experiments.cli.staging import PAGE, TABLE, YAML, staged_file
from experiments.report.files import write_text
from systems.vision.calibration.observation_file import observation_text, read_observations
from systems.vision.calibration.wand import CalibrationKit, SimulatedWandRun, WandRun, simulate_wand_run
from systems.vision.calibration.wand_calibration import calibrate_with_wand
from systems.vision.camera_model import Cameras
from systems.vision.camera_rig import MeasuringCell, load_cell
from systems.vision.camera_rig_file import cell_text, with_cameras

SIMULATED = "simulated"

cameras_app = command_app("Calibrate the cameras of a cell, and study what limits the accuracy of a pose.")

cameras_app.command("budget")(budget_command)
cameras_app.command("body")(body_command)

CellOption = Annotated[
    str, typer.Option("--cell", metavar="NAME|FILE", help="A shipped measuring cell or a YAML file.")
]


@cameras_app.command("calibrate")
def calibrate_cameras_command(
    recording: Annotated[
        str,
        typer.Option(metavar="FILE.csv", help="Observations of wand and L-frame, or simulated."),
    ] = SIMULATED,
    cell: CellOption = "probst",
    wand_length: Annotated[
        float, typer.Option("--wand-length", metavar="MM", help="Length of the wand between its two spheres.")
    ] = CalibrationKit.wand_length_mm,
    places: Annotated[
        int | None,
        typer.Option(
            metavar="N", help="Number of simulated wand poses.", show_default=str(SimulatedWandRun.places)
        ),
    ] = None,
    pixel_sigma: Annotated[
        float,
        typer.Option(
            "--pixel-sigma", metavar="PX", help="Expected standard deviation of an image coordinate."
        ),
    ] = SimulatedWandRun.pixel_sigma,
    seed: Annotated[
        int | None,
        typer.Option(metavar="N", help="Seed of the simulated noise and motion.", show_default="0"),
    ] = None,
    write_recording: Annotated[
        str | None,
        typer.Option(
            "--write-recording", metavar="FILE.csv", help="Keep what was observed, for --recording."
        ),
    ] = None,
    write: Annotated[
        str | None, typer.Option(metavar="FILE.yaml", help="The cell with the calibrated cameras.")
    ] = None,
    out: PictureOption = Path("out/cameras.html"),
    json_file: JsonOption = None,
) -> None:
    """Calibrate poses and lenses of the cameras with a wand and an L-frame."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        in_millimetres("--wand-length", wand_length)
        positive("--pixel-sigma", pixel_sigma)
        at_least("--seed", 0, seed)
        if recording != SIMULATED:
            without_effect("--places", places, "--recording: nothing is simulated")
            without_effect("--seed", seed, "--recording: nothing is simulated")
        nominal, kit = load_cell(cell), CalibrationKit(wand_length_mm=wand_length)
        names = [camera.name for camera in nominal.cameras]
        page = stack.enter_context(staged_file(out, *PAGE))
        seen_file = stack.enter_context(staged_file(write_recording, *TABLE)) if write_recording else None
        cell_file = stack.enter_context(staged_file(write, *YAML)) if write else None
        stack.enter_context(output.staged())
        # The camera system's own frame is that of the L-frame.
        start, truth = nominal.camera_model(nominal.base.pose()), None
        if recording == SIMULATED:
            truth = start
            waved = SimulatedWandRun(
                SimulatedWandRun.places if places is None else places, pixel_sigma=pixel_sigma
            )
            run = _simulated(nominal, kit, truth, waved, seed or 0)
            start = replace(start, radial=0.0 * start.radial, tangential=0.0 * start.tangential)
        else:
            run = read_observations(recording, names, len(kit.p_Q), nominal.sensor_px)
        started = time.perf_counter()
        with human.status("Adjusting cameras and lenses"):
            calibration = calibrate_with_wand(run, kit, start, names, pixel_sigma)
        found = CamerasFound(calibration, names, kit, time.perf_counter() - started, truth)
        title = f"{nominal.name}, {'simulated' if truth else Path(recording).name}"
        write_calibration_page(page, title, found)
        if cell_file:
            source = f"truetip cameras calibrate, {len(calibration.wand_lengths)} places of the wand"
            write_text(cell_file, cell_text(with_cameras(nominal, calibration.cameras, source)))
        if seen_file:
            write_text(seen_file, observation_text(run, names))
        output.write(calibration_json(found))
    print_calibration(human, found)
    print_files(human, out, write, write_recording)


def _simulated(
    cell: MeasuringCell, kit: CalibrationKit, truth: Cameras, run: SimulatedWandRun, seed: int
) -> WandRun:
    return simulate_wand_run(truth, cell.sensor_px, kit, run, np.random.default_rng(seed))[0]


@cameras_app.command("study")
def study_cameras_command(
    scenario: ScenarioOption = "misaligned",
    settings: SetOption = None,
    is_quick: Annotated[
        bool, typer.Option("--quick", help="A faster path and less settling for the laws.")
    ] = False,
    without_laws: Annotated[
        bool, typer.Option("--without-laws", help="Geometry and images only; a few seconds.")
    ] = False,
    jobs: JobsOption = None,
    scheduler: SchedulerOption = None,
    out: PictureOption = Path("out/study.html"),
    json_file: JsonOption = None,
) -> None:
    """Study how cameras, light and markers limit the pose accuracy, and the effect on the laws."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        at_least("--jobs", 1, jobs)
        prepared = prepare(scenario, [*(settings or []), "station.camera=images"])
        page = stack.enter_context(staged_file(out, *PAGE))
        stack.enter_context(output.staged())
        setup = study_setup(prepared)
        where = executor(scheduler, jobs)
        covariance_on_path, covariance_in_workspace = covariances(setup)
        with progress_bar("Geometry and images") as progress:
            sweeps = study_sweeps(setup, where, progress)
        laws = []
        if not without_laws:
            with progress_bar("Servo laws") as progress:
                laws = study_laws(scenario, settings or [], is_quick, where, progress)
        study = CamerasStudy(setup, covariance_on_path, covariance_in_workspace, sweeps, laws)
        write_study_page(page, prepared.title, study)
        output.write(study_json(study))
    print_study(human, study)
    print_files(human, out)

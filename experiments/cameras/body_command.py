"""``truetip cameras body``: where the markers of a body should be."""

from contextlib import ExitStack
from dataclasses import replace
from typing import Annotated

import numpy as np
import typer
from pydrake.common.yaml import yaml_dump_typed

from experiments.cameras.accuracy import Places, accuracy, information, pose_covariance
from experiments.cameras.study import study_setup
from experiments.cameras.sweeps import SweepSetup
from experiments.cli.console import print_files, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least
from experiments.cli.options import JsonOption, ScenarioOption, SetOption
from experiments.cli.prepare import prepare
from experiments.cli.staging import YAML, staged_file
from experiments.report.files import write_text
from systems.vision.body_design import distinct, optimised_markers, spacing

_PLACES = 10  # of the path, that are looked at in every step


def body_command(
    scenario: ScenarioOption = "misaligned",
    settings: SetOption = None,
    steps: Annotated[int, typer.Option(metavar="N", help="Random steps of one marker each.")] = 10000,
    apart: Annotated[
        float, typer.Option("--apart-mm", metavar="MM", help="Least distance of two markers.")
    ] = 60.0,
    differ: Annotated[
        float, typer.Option("--differ-mm", metavar="MM", help="By which any two distances differ at least.")
    ] = 1.0,
    write: Annotated[
        str | None,
        typer.Option(metavar="FILE.yaml", help="The body, for --set station.camera.body=FILE.yaml."),
    ] = None,
    json_file: JsonOption = None,
) -> None:
    """Move the markers of a body to where they determine its pose best along a path."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        at_least("--steps", 1, steps)
        prepared = prepare(scenario, [*(settings or []), "station.camera=images"])
        file = stack.enter_context(staged_file(write, *YAML)) if write else None
        stack.enter_context(output.staged())
        setup = study_setup(prepared)
        chosen = np.linspace(0, len(setup.path.q) - 1, _PLACES).astype(int)
        looked_at = Places(setup.path.X_WE[chosen], setup.path.q[chosen])
        with progress_bar(f"{steps} steps") as progress:
            p_E = optimised_markers(
                setup.body.p_E,
                lambda markers: _score(setup, markers, looked_at),
                steps,
                prepared.scenario.seed,
                1e-3 * apart,
                1e-3 * differ,
                progress,
            )
        numbers = {
            "path_um": [1e6 * _score(setup, each, setup.path) for each in (setup.body.p_E, p_E)],
            "workspace_um": [1e6 * _median(setup, each, setup.workspace) for each in (setup.body.p_E, p_E)],
            "markers_mm": np.round(1e3 * p_E, 1).tolist(),
            "spacing_mm": 1e3 * spacing(p_E),
            "distinct_mm": 1e3 * distinct(p_E),
        }
        if file:
            source = f"truetip cameras body, from {setup.body.name}, {steps} steps on {prepared.title}"
            body = replace(setup.body, markers_mm=np.round(1e3 * p_E, 1), source=source)
            write_text(file, str(yaml_dump_typed(body)))
        output.write(numbers)
    path, workspace = numbers["path_um"], numbers["workspace_um"]
    human.print(
        f"Standard deviation of the tool's position: {path[0]:.1f} to {path[1]:.1f} µm in the mean along the "
        f"path, {workspace[0]:.1f} to {workspace[1]:.1f} µm in the median over the workspace"
    )
    print_files(human, write)


def _score(setup: SweepSetup, p_E: np.ndarray, places: Places) -> float:
    """Root mean variance of a coordinate at places in m; infinite if one of them is not seen."""
    variance = np.diagonal(_covariance(setup, p_E, places), axis1=1, axis2=2)[:, 3:]
    return float(np.sqrt(variance.mean())) if np.isfinite(variance).all() else np.inf


def _median(setup: SweepSetup, p_E: np.ndarray, places: Places) -> float:
    return accuracy(_covariance(setup, p_E, places)).position


def _covariance(setup: SweepSetup, p_E: np.ndarray, places: Places) -> np.ndarray:
    body = replace(setup.body, markers_mm=1e3 * p_E)
    cameras = setup.cell.camera_model(setup.robot.base.pose())
    seen = information(cameras, setup.cell.windows, body, places, setup.robot).sum(1)
    return pose_covariance(seen, setup.pixel_sigma)

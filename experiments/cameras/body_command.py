"""``truetip cameras body``: where the markers of a body should be."""

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from pydrake.common.yaml import yaml_dump_typed

from experiments.cameras.accuracy import Places
from experiments.cameras.body_page import MovedBody, covariance, root_mean, write_body_page
from experiments.cameras.study import study_setup
from experiments.cli.console import print_files, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least, not_negative
from experiments.cli.options import JsonOption, PictureOption, ScenarioOption, SetOption
from experiments.cli.prepare import prepare
from experiments.cli.staging import PAGE, YAML, staged_file
from experiments.report.files import write_text
from systems.vision.body_design import optimised_markers

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
    report: PictureOption = Path("out/body.html"),
    json_file: JsonOption = None,
) -> None:
    """Move the markers of a body to where they determine its pose best along a path."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        at_least("--steps", 1, steps)
        not_negative("--apart-mm", apart)
        not_negative("--differ-mm", differ)
        prepared = prepare(scenario, [*(settings or []), "station.camera=images"])
        page = stack.enter_context(staged_file(report, *PAGE))
        file = stack.enter_context(staged_file(write, *YAML)) if write else None
        stack.enter_context(output.staged())
        setup = study_setup(prepared)
        chosen = np.linspace(0, len(setup.path.q) - 1, _PLACES).astype(int)
        looked_at = Places(setup.path.X_WE[chosen], setup.path.q[chosen])
        with progress_bar(f"{steps} steps") as progress:
            p_E = optimised_markers(
                setup.body.p_E,
                lambda markers: root_mean(covariance(setup, markers, looked_at)),
                steps,
                prepared.scenario.seed,
                1e-3 * apart,
                1e-3 * differ,
                progress,
            )
        moved = MovedBody(setup, p_E, steps)
        write_body_page(page, prepared.title, moved)
        if file:
            source = f"truetip cameras body, from {setup.body.name}, {steps} steps on {prepared.title}"
            body = replace(setup.body, markers_mm=np.round(1e3 * p_E, 1), source=source)
            write_text(file, str(yaml_dump_typed(body)))
        output.write(moved.numbers)
    human.print(moved.verdict)
    print_files(human, report, write)

"""``truetip diagram``."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from diagrams.runs.simulation import Experiment
from experiments.cli.console import (
    refusing,
)
from experiments.cli.options import (
    LawOption,
    RobotOption,
    ScenarioOption,
    SetOption,
)
from experiments.cli.prepare import option_settings, prepare
from experiments.cli.staging import staged_file
from experiments.diagram.view import write_diagram


def diagram_command(
    law: LawOption = None,
    scenario: ScenarioOption = "misaligned",
    settings: SetOption = None,
    robot: RobotOption = None,
    out: Annotated[
        Path,
        typer.Option(
            "--write",
            metavar="FILE.svg|FILE.dot",
            help="The drawing as SVG, or its source for graphviz.",
        ),
    ] = Path("diagram.svg"),
    depth: Annotated[int, typer.Option(metavar="N", help="Depth to which nested diagrams are expanded.")] = 2,
) -> None:
    """Draw the diagram that is simulated.

    The station is drawn as a diagram of its own; in a run its parts stand beside the servo, which is quicker.
    """
    with refusing(ValueError, OSError):
        prepared = prepare(scenario, option_settings(settings, law, None), robot)
        experiment = Experiment(prepared.scenario, prepared.scenario.law, prepared.robot, is_nested=True)
        with staged_file(out) as path:
            write_diagram(path, experiment.diagram, depth)
    Console().print(f"The diagram: {escape(str(out))}")

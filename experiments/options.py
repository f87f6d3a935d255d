"""Options that several commands have."""

from pathlib import Path
from typing import Annotated

import typer

from systems.feedforward import FEEDFORWARDS

ScenarioOption = Annotated[
    str, typer.Option("--scenario", metavar="NAME|FILE", help="A shipped scenario or a YAML file.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a value, as station.payload=0; repeatable."),
]
RobotOption = Annotated[
    str | None,
    typer.Option(
        "--robot",
        metavar="NAME|FILE",
        help="A robot in place of the scenario's, or a calibrated one for the controller.",
    ),
]
FeedforwardOption = Annotated[
    str | None,
    typer.Option(
        "--feedforward",
        metavar="NAME",
        help=f"An inverse model beside the law: none, {', '.join(FEEDFORWARDS)}.",
        show_default="the scenario's",
    ),
]
OutOption = Annotated[Path, typer.Option("--out", metavar="DIR", help="Where the results go.")]

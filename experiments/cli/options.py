"""Options that several commands have."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from systems.cell.cameras import CAMERAS
from systems.feedforward import FEEDFORWARDS
from systems.servo import LAWS


def _scenarios(incomplete: str) -> list[str]:
    # Imported where a shell asks for names, so that no other command waits for it.
    from diagrams.scenario.scenario_file import shipped_scenarios

    return _beginning_with(incomplete, shipped_scenarios())


def _robots(incomplete: str) -> list[str]:
    from robots.description.model import shipped_robots

    return _beginning_with(incomplete, shipped_robots())


def _laws(incomplete: str) -> list[str]:
    return _beginning_with(incomplete, LAWS)


def _beginning_with(incomplete: str, names: Iterable[str]) -> list[str]:
    """Where no name fits, shells go on with files."""
    return [name for name in names if name.startswith(incomplete)]


ScenarioOption = Annotated[
    str,
    typer.Option(
        "--scenario",
        metavar="NAME|FILE",
        help="A shipped scenario or a YAML file.",
        autocompletion=_scenarios,
    ),
]
# Without a name the command chooses one that fits.
AnyScenarioOption = Annotated[
    str | None,
    typer.Option(
        "--scenario",
        metavar="NAME|FILE",
        help="A shipped scenario or a YAML file.",
        show_default="misaligned; on a station cell or cell-kuka",
        autocompletion=_scenarios,
    ),
]
StationOption = Annotated[
    str | None,
    typer.Option(
        "--station",
        metavar="NAME",
        help="simulated, or egm or rsi for a controller of ABB or KUKA and a camera on the wire.",
    ),
]
WithCellOption = Annotated[
    bool, typer.Option("--with-cell", help="Start a virtual cell on loopback, in real time.")
]
YesOption = Annotated[
    bool, typer.Option("--yes", help="Do not ask for confirmation before a real robot moves.")
]
LawOption = Annotated[
    str | None,
    typer.Option(
        "--law",
        metavar="NAME|FILE:CLASS",
        help=f"One of {', '.join(LAWS)}, or my_law.py:MyLaw.",
        show_default="the scenario's",
        autocompletion=_laws,
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Set a value of the scenario, for example station.payload=0; repeatable.",
    ),
]
RobotOption = Annotated[
    str | None,
    typer.Option(
        "--robot",
        metavar="NAME|FILE",
        help="A robot in place of the scenario's, or a calibrated one for the controller.",
        autocompletion=_robots,
    ),
]
# Of a study that takes a robot and no scenario.
StudiedRobotOption = Annotated[
    str,
    typer.Option(
        "--robot",
        metavar="NAME|FILE",
        help="A shipped robot, a YAML file or a URDF.",
        autocompletion=_robots,
    ),
]
PayloadOption = Annotated[
    float | None,
    typer.Option(
        "--payload", metavar="KG", help="Mass at the flange.", show_default="the largest it may carry"
    ),
]
GridOption = Annotated[
    int, typer.Option("--grid", metavar="N", help="Grid points along each of the axes 2 and 3.")
]
FeedforwardOption = Annotated[
    str | None,
    typer.Option(
        "--feedforward",
        metavar="NAME",
        help=f"An inverse model beside the law: none, {', '.join(FEEDFORWARDS)}, or my_model.py:MyModel.",
        show_default="the scenario's",
    ),
]
CameraOption = Annotated[
    str | None,
    typer.Option(
        "--camera",
        metavar="NAME",
        help=f"How the tip is measured: {', '.join(CAMERAS)} (of markers).",
        show_default="the scenario's",
    ),
]
LapsOption = Annotated[
    int | None,
    typer.Option(
        "--laps",
        metavar="N",
        help="Laps of the path within one run; a law keeps what it has learnt.",
        show_default="the scenario's",
    ),
]
JobsOption = Annotated[
    int | None,
    typer.Option("--jobs", metavar="N", help="Number of parallel processes.", show_default="one per core"),
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="A Dask scheduler whose workers do the runs, for example tcp://host:8786.",
        show_default="processes of this machine",
    ),
]
OutOption = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the results.")]
PictureOption = Annotated[
    Path, typer.Option("--report", metavar="FILE.html", help="The page with the result.")
]


def json_option(text: str) -> Any:
    """``--json`` with a help text of its own; what it does is in `json_output`."""
    return typer.Option("--json", metavar="FILE|-", help=text)


JsonOption = Annotated[str | None, json_option("The numbers; - prints them, and nothing else.")]
RealTimeOption = Annotated[
    int | None,
    typer.Option(
        "--realtime",
        metavar="PRIORITY",
        help="On a station: run before all other processes (SCHED_FIFO, 1 to 99), memory locked.",
    ),
]
FoxgloveOption = Annotated[
    str | None,
    typer.Option(
        "--foxglove",
        metavar="[HOST:]PORT",
        help="Show a run on a station live in Foxglove, on this machine unless a host is named.",
    ),
]
McapOption = Annotated[
    bool,
    typer.Option("--mcap", help="Write every simulated run as LAW-CYCLE.mcap too; on hardware always."),
]

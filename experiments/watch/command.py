"""``truetip watch``: people in the cell, and what they do to the speed of the robot."""

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from diagrams.scenario.scenario import load_scenario
from diagrams.scenario.scenario_file import OptionSetting
from experiments.cli.console import BROKEN_OFF, fail, print_files, print_note, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least, not_negative, positive, refuse_given
from experiments.cli.options import JsonOption, PictureOption, RobotOption, SetOption, WithCellOption
from experiments.cli.prepare import prepare
from experiments.cli.staging import PAGE, staged_file
from experiments.station.guided_command import on_station
from experiments.watch.data_rates import data_rates
from experiments.watch.live_command import watch_station
from experiments.watch.page import AID, run_verdict, study_verdict, write_run_page, write_study_page
from experiments.watch.run import seen_by_network, watch_recorded, watch_simulated
from experiments.watch.study import study_watch
from robots.description.source_notes import foreign_sources_note
from systems.link.udp_channel import ChannelError
from systems.vision.people.person_networks import PersonNetwork
from systems.vision.people.surroundings import load_surroundings

_CELLS = {"egm": "cell-watched", "rsi": "cell-kuka-watched"}  # the shipped scenario of each link


def watch_command(
    context: typer.Context,
    scenario: Annotated[
        str | None,
        typer.Option(
            "--scenario",
            metavar="NAME|FILE",
            help="A shipped scenario or a YAML file.",
            show_default="watched; on a station cell-watched or cell-kuka-watched",
        ),
    ] = None,
    settings: SetOption = None,
    robot: RobotOption = None,
    images: Annotated[
        str | None,
        typer.Option(
            metavar="FOLDER|VIDEO",
            help="Recorded images in place of a simulation: joints.csv, and a folder of pictures or a video "
            "of each camera; or a video of all side by side, with its table NAME.csv.",
        ),
    ] = None,
    empty: Annotated[
        int, typer.Option(metavar="N", help="How many of the first recorded sets show the empty cell.")
    ] = 10,
    study: Annotated[
        bool, typer.Option("--study", help="How well people are seen at random places, and false stops.")
    ] = False,
    places: Annotated[int, typer.Option(metavar="N", help="Number of places in a study.")] = 30,
    minutes: Annotated[
        float, typer.Option(metavar="MIN", help="Minutes of the empty cell in a study; 0 for none.")
    ] = 10.0,
    every: Annotated[
        float, typer.Option(metavar="S", help="Time between two sets of images of the empty cell in a study.")
    ] = 2.0,
    network: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="A detection network that looks at the pictures of the page too: .onnx of make detector, or "
            ".cfg of a tiny YOLO v3 with .weights beside it.",
        ),
    ] = None,
    station: Annotated[
        str | None,
        typer.Option(
            "--station",
            metavar="NAME",
            help="A running cell: egm or rsi, whose controller says where its robot is.",
        ),
    ] = None,
    with_cell: WithCellOption = False,
    duration: Annotated[
        float | None, typer.Option(metavar="S", help="Of a running cell; by default until Ctrl-C.")
    ] = None,
    out: PictureOption = Path("out/watch.html"),
    json_file: JsonOption = None,
) -> None:
    """Watch for people, simulated, recorded or in a running cell; an aid, not a safety function.

    In a simulation the robot is slowed and stopped for them. In a running cell, whose robot somebody else
    moves, it is said what would be allowed; the run that guides a robot watches for itself: truetip run
    --scenario cell-watched --station egm.
    """
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError, ChannelError), ExitStack() as stack:
        at_least("--places", 1, places)
        at_least("--empty", 1, empty)
        positive("--every", every)
        positive("--duration", duration)
        not_negative("--minutes", minutes)
        if study and images:
            raise ValueError("--study draws its own images; leave out --images")
        if study and network:
            raise ValueError("--study is of the hull alone; leave out --network")
        if not study:
            refuse_given(context, ("places", "minutes", "every"), "without --study")
        people = PersonNetwork(network) if network else None
        if (station or with_cell) and (study or images):
            raise ValueError("--station and --with-cell watch a running cell; leave out --study and --images")
        prepared = prepare(*_on_station(scenario, settings or [], station, with_cell), robot)
        is_live = prepared.scenario.station.kind != "simulated" and not (study or images)
        if duration is not None and not is_live:
            raise ValueError("--duration is of a running cell: add --station egm, or --with-cell")
        if not is_live and not images:
            refuse_given(
                context, ("empty",), "with simulated images: it is of --images and of a running cell"
            )
        chosen, ground = prepared.scenario, load_surroundings(prepared.scenario.station.overview.surroundings)
        page = stack.enter_context(staged_file(out, *PAGE))
        stack.enter_context(output.staged())
        # Of recorded images nothing is carried over to the robot that is in them.
        print_note(human, foreign_sources_note(prepared.robot) if images else prepared.note)
        title = f"Watch, {prepared.title}"
        problem = ""
        if study:
            with progress_bar(f"{places} places, {minutes:g} minutes of the empty cell") as progress:
                found = study_watch(chosen, prepared.robot, places, minutes, every, progress)
            verdict = study_verdict(found)
            write_study_page(page, title, found)
            output.write(found.as_dict())
        else:
            if is_live:
                run, problem = watch_station(human, prepared, with_cell, empty, duration)
            else:
                with progress_bar(
                    "recorded images" if images else "images are drawn and searched"
                ) as progress:
                    run = (
                        watch_recorded(chosen, prepared.robot, images, empty, progress)
                        if images
                        else watch_simulated(chosen, prepared.robot, chosen.law, progress)
                    )
            if people is not None and run.snapshot is not None:
                run = replace(run, boxes=seen_by_network(people, run))
            print_note(human, escape("; ".join(run.notes)) if images else "")
            verdict = run_verdict(run)
            rates = data_rates(chosen)
            write_run_page(page, title, run, run.cell.detector.cameras, ground, rates)
            output.write({**run.as_dict(), "data_rates_gbit_s": rates})
    human.print(escape(verdict))
    human.print(f"[yellow]{AID}[/yellow]")
    print_files(human, out)
    if problem:
        fail(problem, BROKEN_OFF)


def _on_station(
    scenario: str | None, settings: list[str], station: str | None, with_cell: bool
) -> tuple[str, list[str]]:
    """The scenario and its settings; the controller of a virtual cell moves its robot itself.

    Raises:
        ValueError: if a virtual cell is wanted for a simulated station, or the scenario is refused.
    """
    name, changes = on_station(scenario, settings, station, with_cell, simulated="watched", cells=_CELLS)
    if with_cell and load_scenario(name, changes).station.link.kind == "egm":
        changes = [*changes, OptionSetting("station.link.run.streams", "true", "--with-cell")]
    return name, changes

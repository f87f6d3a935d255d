"""``truetip watch``: people in the cell, and what they do to the speed of the robot."""

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from experiments.cli.console import print_files, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least, positive
from experiments.cli.options import JsonOption, PictureOption, RobotOption, ScenarioOption, SetOption
from experiments.cli.prepare import prepare, simulated_only
from experiments.cli.staging import PAGE, staged_file
from experiments.watch.page import AID, run_verdict, study_verdict, write_run_page, write_study_page
from experiments.watch.run import seen_by_network, watch_recorded, watch_simulated
from experiments.watch.study import study_watch
from systems.vision.people.person_networks import PersonNetwork
from systems.vision.people.surroundings import load_surroundings


def watch_command(
    scenario: ScenarioOption = "watched",
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
    out: PictureOption = Path("out/watch.html"),
    json_file: JsonOption = None,
) -> None:
    """Watch for people and slow the robot for them; an aid, not a safety function.

    In a simulation or on recorded images. A running cell is watched by the run that guides its robot: truetip
    run --scenario cell-watched --station egm, or --with-cell to try it.
    """
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        at_least("--places", 1, places)
        at_least("--empty", 1, empty)
        positive("--every", every)
        if minutes < 0.0:
            raise ValueError(f"--minutes must not be negative, got {minutes:g}")
        if study and images:
            raise ValueError("--study draws its own images; leave out --images")
        if study and network:
            raise ValueError("--study is of the hull alone; leave out --network")
        people = PersonNetwork(network) if network else None
        prepared = prepare(scenario, settings or [], robot)
        simulated_only(prepared, "watch", "give recorded images with --images")
        chosen, ground = prepared.scenario, load_surroundings(prepared.scenario.station.overview.surroundings)
        page = stack.enter_context(staged_file(out, *PAGE))
        stack.enter_context(output.staged())
        title = f"Watch, {prepared.title}"
        if study:
            with progress_bar(f"{places} places, {minutes:g} minutes of the empty cell") as progress:
                found = study_watch(chosen, prepared.robot, places, minutes, every, progress)
            verdict = study_verdict(found)
            write_study_page(page, title, found)
            output.write(found.as_dict())
        else:
            with progress_bar("recorded images" if images else "images are drawn and searched") as progress:
                run = (
                    watch_recorded(chosen, prepared.robot, images, empty, progress)
                    if images
                    else watch_simulated(chosen, prepared.robot, chosen.law, progress)
                )
            if people is not None and run.snapshot is not None:
                run = replace(run, boxes=seen_by_network(people, run))
            verdict = run_verdict(run)
            write_run_page(page, title, run, run.cell.detector.cameras, ground)
            output.write(run.as_dict())
    human.print(escape(verdict))
    human.print(f"[yellow]{AID}[/yellow]")
    print_files(human, out)

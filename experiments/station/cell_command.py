"""``truetip cell``: a robot cell that exists only in this process, for clients of robot and camera."""

import ipaddress
import json
import os
import signal
import sys
import threading
from contextlib import ExitStack
from dataclasses import fields
from types import FrameType
from typing import Annotated

import typer
from rich.console import Console

from diagrams.runs.cell_loop import CellLoop, CellStatistics
from diagrams.runs.shown_cell import ShownCell
from diagrams.scenario.scenario_file import OptionSetting
from experiments.cli.console import count, print_note, refusing
from experiments.cli.options import RobotOption, ScenarioOption, SetOption, json_option
from experiments.cli.prepare import prepare
from experiments.cli.staging import staged_file
from experiments.report.files import write_json
from robots.configuration.suggestion import did_you_mean
from systems.cell.network_faults import FaultConfig


def cell_command(
    scenario: ScenarioOption = "cell",
    settings: SetOption = None,
    robot: RobotOption = None,
    faults: Annotated[
        str | None,
        typer.Option(
            metavar="NAME=VALUE,...",
            help=f"What goes wrong: {', '.join(entry.name for entry in fields(FaultConfig))}.",
        ),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(metavar="S", help="Stop after this time; by default at Ctrl-C.")
    ] = None,
    truth: Annotated[
        str | None,
        typer.Option(metavar="FILE.npz", help="Record of the true motion, by the controller's time stamps."),
    ] = None,
    json_file: Annotated[str | None, json_option("How it ran, at the end.")] = None,
    peer: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Obey this machine alone.",
            show_default="the first that sends a command",
        ),
    ] = "",
    address: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Of this machine, to hear commands on.")
    ] = "127.0.0.1",
    images: Annotated[
        int | None,
        typer.Option(
            "--show-images",
            metavar="PORT",
            help="Show what the cameras of station.overview see, http://127.0.0.1:PORT/CAMERA for each.",
        ),
    ] = None,
    announce: Annotated[
        bool, typer.Option("--announce", help="Print the ports as one line of JSON first, for scripts.")
    ] = False,
    until_eof: Annotated[
        bool,
        typer.Option("--until-eof", help="Stop when standard input closes: with whoever started it."),
    ] = False,
) -> None:
    """Run a virtual robot cell in real time: a controller under EGM or RSI, and a camera server."""
    human = Console(stderr=announce)
    with refusing(ValueError, OSError), ExitStack() as stack:
        if duration is not None and not duration > 0.0:
            raise ValueError(f"--duration must be positive, got {duration:g} s")
        if peer:
            _check_address("--peer", peer)
        prepared = prepare(scenario, [*(settings or []), *fault_settings(faults)], robot)
        files = [
            stack.enter_context(staged_file(name, suffix)) if name else None
            for name, suffix in ((truth, ".npz"), (json_file, ".json"))
        ]
        link = prepared.scenario.station.link
        shown = None
        if images is not None:
            if not prepared.scenario.station.overview.enabled:
                raise ValueError("--show-images needs cameras of the whole cell: --scenario cell-watched")
            shown = ShownCell(prepared.scenario, prepared.nominal_robot, images)
            stack.callback(shown.close)
        camera = stack.enter_context(link.camera.virtual_server(prepared.scenario.station.camera.period))
        loop = CellLoop(
            prepared.scenario,
            prepared.nominal_robot,
            (link.address, link.port),
            camera,
            (link.address, link.signal_port) if link.signal_port else None,
            address=address,
            with_log=truth is not None,
            peer=peer,
            tell=human.print,
            note_joints=shown.note_joints if shown else None,
        )
        stack.callback(loop.close)
        stop = _Stop(duration, until_eof)
        print_note(human, prepared.note)
        if announce:
            ports = {"camera_port": camera.port} | ({"image_port": shown.port} if shown else {})
            sys.stdout.write(json.dumps(ports) + "\n")
            sys.stdout.flush()
        human.print(
            f"{prepared.nominal_robot.name}: speaks {link.title} to UDP {link.address}:{link.port} every "
            f"{1e3 * prepared.scenario.station.period:g} ms; its camera listens on {camera.place}"
        )
        if shown:
            human.print(
                f"what its cameras see is at http://127.0.0.1:{shown.port}/{{camera}}", highlight=False
            )
        if duration is None and not announce:
            human.print("Ctrl-C ends it")
        statistics = loop.run(stop.is_reached)
        camera.finish()
        if files[0]:
            loop.cell.record().save(files[0])
        if files[1]:
            write_json(files[1], statistics.as_dict())
    print_statistics(human, statistics)


def fault_settings(faults: str | None) -> list[OptionSetting]:
    """``loss=0.05,jitter=0.003`` as settings of a scenario.

    Raises:
        ValueError: if a part is no NAME=VALUE with a known name.
    """
    known = [entry.name for entry in fields(FaultConfig)]
    settings = []
    for part in filter(None, map(str.strip, (faults or "").split(","))):
        name, equals, value = map(str.strip, part.partition("="))
        if not equals or name not in known:
            guess = ", which has no value" if name in known else did_you_mean(name, known)
            raise ValueError(f"--faults takes NAME=VALUE with names {', '.join(known)}, got '{part}'{guess}")
        settings.append(OptionSetting(f"station.faults.{name}", value, f"--faults {name}="))
    return settings


def print_statistics(console: Console, statistics: CellStatistics) -> None:
    """Prints the statistics of a cell."""
    lateness = 1e3 * statistics.worst_lateness
    console.print(
        f"{count(statistics.cycles, 'cycle')}, {statistics.late} of them more than 1 ms late (worst "
        f"{lateness:.1f} ms); {count(statistics.commands, 'datagram')} came in"
        f"{f' ({statistics.strangers} of strangers)' if statistics.strangers else ''}, "
        f"{count(statistics.camera_frames, 'camera frame')} went out"
    )
    for link, counts in statistics.faults.items():
        happened = ", ".join(f"{number} {name}" for name, number in counts.items() if number)
        if happened:
            console.print(f"Faults {link}: {happened}")


class _Stop:
    """The stop condition of a cell: a duration, Ctrl-C or a signal, or the end of standard input."""

    def __init__(self, duration: float | None, until_eof: bool) -> None:
        self._duration, self._is_asked = duration, False
        if until_eof:
            threading.Thread(target=self._read, daemon=True).start()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._ask)

    def _read(self) -> None:
        # Not by way of sys.stdin, whose lock a daemon thread would still hold when the interpreter ends.
        while os.read(0, 4096):
            pass
        self._is_asked = True

    def _ask(self, number: int, frame: FrameType | None) -> None:
        self._is_asked = True

    def is_reached(self, time: float) -> bool:
        """Whether to stop at the cell's time in s."""
        return self._is_asked or (self._duration is not None and time >= self._duration)


def _check_address(option: str, given: str) -> None:
    try:
        ipaddress.ip_address(given)
    except ValueError:
        raise ValueError(f"{option} must be an address such as 192.168.125.1, got '{given}'") from None

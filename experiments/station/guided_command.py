"""What ``truetip compare`` and ``truetip run`` do on a real station."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import typer
from rich.console import Console

from diagrams.real_time_priority import real_time_priority
from diagrams.record.foxglove_server import FoxgloveServer
from diagrams.record.log import RunLog
from diagrams.record.run_record import PATH, RunRecord
from diagrams.runs.real_time import RealTimeRecord
from diagrams.scenario.scenario import StationConfig, load_scenario
from diagrams.scenario.scenario_file import OptionSetting
from experiments.cli.command_table import stays
from experiments.cli.console import BROKEN_OFF, count, progress_bar, refusing
from experiments.cli.ending import asking
from experiments.cli.prepare import Prepared
from experiments.cli.staging import keep_files
from experiments.cli.workers import SimulationError
from experiments.report.files import write_json
from experiments.report.style import law_file_name
from experiments.station.acknowledging import acknowledging, how
from experiments.station.guided import compare_on_station
from systems.link.makers import LINK_NAMES
from systems.link.udp_channel import ChannelError, is_loopback
from systems.named_classes import OwnClassError
from systems.reference.paths import make_path

_CELLS = {"egm": "cell", "rsi": "cell-kuka"}  # the shipped scenario of each link


def on_station(
    scenario: str | None,
    settings: list[str],
    station: str | None,
    with_cell: bool,
    simulated: str = "misaligned",
    cells: Mapping[str, str] = _CELLS,
) -> tuple[str, list[str]]:
    """The scenario and its settings with the options that choose a station.

    Args:
        scenario: as asked for; None for the shipped one.
        settings: of the command line.
        station: what stands there; None for what the scenario says.
        with_cell: whether a virtual cell shall stand there.
        simulated: the shipped scenario of a simulated station.
        cells: the shipped scenario of each link; a virtual cell is the first unless another is asked for.

    Raises:
        ValueError: if a virtual cell is wanted for a simulated station, or the scenario is refused.
    """
    if with_cell and station == "simulated":
        raise ValueError(f"--with-cell needs --station {' or '.join(LINK_NAMES)}, got '{station}'")
    name = scenario or cells.get(station or "", next(iter(cells.values())) if with_cell else simulated)
    kind = station or (load_scenario(name, settings).station.link.kind if with_cell else None)
    return name, [*settings, *([OptionSetting("station.kind", kind, "--station")] if kind else [])]


def check_measures_alone(who: str, station: StationConfig) -> None:
    """Refuses a station where a measurement sees nothing, or would not stop for people that are watched for.

    Args:
        who: what measures, for the message.
        station: of hardware.

    Raises:
        ValueError: if so.
    """
    if not station.link.has_camera:
        raise ValueError(f"{who} needs a camera: station.link.has_camera is false")
    if station.overview.enabled:
        raise ValueError(
            f"{who} does not watch for people: add --set station.overview.enabled=false, and see that nobody "
            "is near"
        )


def ask_before_moving(console: Console, prepared: Prepared, is_agreed: bool) -> None:
    """Asks whether a robot that is not on this machine may move.

    Raises:
        typer.Exit: if it may not.
        ValueError: if nobody can be asked.
    """
    address = prepared.scenario.station.link.address
    if is_loopback(address) or is_agreed:
        return
    if not sys.stdin.isatty():
        raise ValueError("a real robot would move: say --yes if it may")
    if not typer.confirm(f"The robot that speaks to {address} will move to the start of the path. Go on?"):
        raise typer.Exit


@dataclass(frozen=True)
class Guided:
    """Runs on a station that can be reported on, and how the command ends after that."""

    logs: Mapping[str, Sequence[RunLog]]
    endings: list[str]  # of the runs that did not reach the end of their path
    code: int  # exit code

    def conclude(self) -> None:
        """Says on stderr which runs ended early, and ends the command if one did. Raises typer.Exit."""
        for ending in self.endings:
            typer.echo(f"truetip: {ending}", err=True)
        if self.code:
            raise typer.Exit(self.code)


def guide(
    console: Console,
    folders: tuple[Path, Path],
    prepared: Prepared,
    laws: Sequence[str],
    cycles: int,
    with_cell: bool,
    viewer: FoxgloveServer | None = None,
    priority: int | None = None,
) -> Guided:
    """Runs laws on a station, writes ``link.json`` and the whole logs, and says what happened on the wire.

    Ctrl-C and SIGTERM stop the robot smoothly; what there is until then is reported on.

    Args:
        console: where to say it.
        folders: where the results are staged, and where they go in the end. If a run breaks off before its
            path has begun there is nothing to report on, but what was recorded goes there all the same.
        prepared: what to run.
        laws: which laws.
        cycles: runs of each law.
        with_cell: whether to start a virtual cell.
        viewer: sees what is recorded at once.
        priority: of the real-time scheduler, None to do without.

    Raises:
        SimulationError: if the station is not there or no run has come as far as its path.
        typer.Exit: if somebody ended it before a path had begun.
    """
    stage, out = folders
    where = "a virtual cell" if with_cell else f"UDP port {prepared.scenario.station.link.port}"
    streams: list[RunRecord] = []

    def recording(law: str, number: int) -> RunRecord:
        # Where it stays: what is only moved there in the end is lost with the process.
        out.mkdir(parents=True, exist_ok=True)
        path = out / f"{law_file_name(law)}-{number}.mcap"
        streams.append(RunRecord(path, prepared.kept, viewer))
        stays(path)
        return streams[-1]

    label = f"{count(cycles * len(laws), 'run')} on {where}"
    scenario = prepared.scenario
    if scenario.station.overview.enabled and scenario.servo.separation.acknowledge:
        console.print(how())
    with (
        refusing(ChannelError, OwnClassError),
        asking() as end,
        acknowledging() as given,
        progress_bar(label) as progress,
        real_time_priority(priority),
    ):
        comparison = compare_on_station(
            scenario,
            prepared.robot,
            laws,
            cycles,
            with_cell,
            progress,
            end.is_asked,
            recording,
            given.is_given,
        )
    link = {**comparison.link_json(), "realtime_priority": priority}
    write_json(stage / "link.json", link)
    records = [
        (law, n, record) for law, all_ in comparison.records.items() for n, record in enumerate(all_, 1)
    ]
    for law, number, record in records:
        write_log(stage / f"{law_file_name(law)}-{number}.npz", record)
    print_link(console, link)
    console.print("Counts, delays and clocks of the wire are in link.json, whole logs in *.npz and *.mcap")
    for problem in filter(None, (stream.problem for stream in streams)):
        typer.echo(f"truetip: {problem}", err=True)
    endings, known = [], {}
    for law, _, record in records:
        if _has_begun(record):
            early = "" if record.ended == PATH else record.ended
            known.setdefault(law, []).append(replace(record.log, ended_early=early))
        if record.ended != PATH:
            when = "before the path had begun"
            if _has_begun(record):
                when = f"at {record.log.time[-1]:.1f} s of {record.log.path_end:.1f} s"
            endings.append(f"law {law}: {when}: {record.ended}")
    if not known:
        keep_files(stage, out)
        if end.code:
            Guided({}, endings, end.code).conclude()
        raise SimulationError(f"{'; '.join(endings)}; see {out / 'link.json'}")
    return Guided(known, endings, end.code or (BROKEN_OFF if endings else 0))


def refuse_real_time(prepared: Prepared, priority: int | None) -> None:
    """Refuses a priority where nobody waits for this process, or nobody permits it. Raises ValueError."""
    if priority is not None and prepared.scenario.station.kind == "simulated":
        raise ValueError("--realtime is for runs on a station; --pace 1 simulates in real time")
    with real_time_priority(priority):
        pass


def foxglove_server(console: Console, prepared: Prepared, address: str | None) -> FoxgloveServer | None:
    """A server that shows the runs of a station, if somebody wants one, with the wanted path in it.

    Raises:
        ValueError: if the station is simulated, or the address cannot be read.
        OSError: if the port is taken.
    """
    if address is None:
        return None
    if prepared.scenario.station.kind == "simulated":
        raise ValueError(
            "--foxglove shows runs on a station as they go on; a simulated run is recorded by --mcap, which "
            "Foxglove opens"
        )
    server = FoxgloveServer(address, prepared.robot)
    path = make_path(prepared.scenario.reference)
    server.show_path(path.sample(np.linspace(path.path_start, path.lap_end, 500))[0][:, :3, 3])
    console.print(f"Foxglove: open {server.address}")
    return server


def _has_begun(record: RealTimeRecord) -> bool:
    """Whether a run has come as far as its path."""
    return len(record.log.time) > 0 and bool(record.log.time[-1] > record.log.path_start)


def write_log(path: Path, record: RealTimeRecord) -> None:
    """Everything that a run on a station has recorded, tick by tick, as arrays with the names of `RunLog`."""
    arrays: dict[str, Any] = {
        name: value for name, value in vars(record.log).items() if isinstance(value, np.ndarray)
    }
    np.savez_compressed(path, **arrays, stamps=record.stamps, turn_around=record.turn_around)


def print_link(console: Console, link: dict[str, Any]) -> None:
    """Prints the statistics of the connection, a line for each run."""
    for law, runs in link["runs"].items():
        for run in runs:
            turn = run["turn_around_ms"]
            events = {
                name: number
                for name, number in {**run["controller"], **run["camera"]}.items()
                if number and name in _WORTH_SAYING
            }
            said = ", ".join(f"{number} {name.replace('_', ' ')}" for name, number in events.items())
            pauses = "".join(
                f"; stood still for {pause:.2f} s at {at:.2f} s" for at, pause in run["pauses_s"]
            )
            pauses += _for_people(run)
            end = "" if run["ended"] == "path" else f"; ended early: {run['ended']}"
            times = (
                f"{turn['median']:.2f} ms (99 %: {turn['99%']:.2f}, largest {turn['largest']:.2f})"
                if turn["median"] is not None
                else "never"
            )
            console.print(f"{law}: answered after {times}{'; ' + said if said else ''}{pauses}{end}")
    if link["cell"]:
        cell = link["cell"]
        console.print(
            f"cell: {cell['late']} of {cell['cycles']} messages more than 1 ms late, "
            f"worst {1e3 * cell['worst_lateness']:.1f} ms"
        )


def _for_people(run: Mapping[str, Any]) -> str:
    """How often and for how long a run was stopped for people, in words; empty where it never was."""
    since, stood, stops = None, 0.0, 0
    for time, kind, _ in run["events"]:
        if kind == "stopped_for_people":
            since, stops = time, stops + 1
        elif kind == "goes_on" and since is not None:
            since, stood = None, stood + time - since
    if not stops:
        return ""
    last = ", and then until the end" if since is not None else ""
    return f"; stopped for people {count(stops, 'time')}, for {stood:.1f} s{last}"


_WORTH_SAYING = (
    *("duplicates", "late", "undecodable", "foreign", "implausible", "missing"),
    *("breaks", "stops", "withheld", "lost_body", "wrong_sender", "garbage"),
    *("disconnections", "impossible", "wrong_time", "overloaded"),
)

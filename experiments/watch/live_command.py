"""What ``truetip watch`` does on a running cell, and what it says meanwhile."""

from functools import partial

from rich.console import Console

from diagrams.hardware_link import EndedOnRequest
from diagrams.live_watch import lookout
from experiments.cli.ending import asking
from experiments.cli.prepare import Prepared
from experiments.station.clients import station_clients
from experiments.watch.live import ADVICE, Decision, LiveWatch
from experiments.watch.run import WatchRun
from systems.vision.people.watch_process import WatchProcess

_SHOWN = 0.25  # s, between two times at which a terminal shows the newest decision


class _Teller:
    """Prints when the zone changes; a terminal shows every decision, in a line that stays."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._status = console.status("waiting for controller and cameras")
        self._zone, self._shown = "", 0.0

    def __enter__(self) -> "_Teller":
        self._status.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._status.stop()

    def tell(self, decision: Decision) -> None:
        if decision.zone != self._zone:
            self._zone = decision.zone
            self._console.print(decision.text, highlight=False)
        if decision.time >= self._shown:
            self._shown = decision.time + _SHOWN
            self._status.update(decision.text)


def watch_station(
    console: Console, prepared: Prepared, with_cell: bool, empty: int, duration: float | None
) -> tuple[WatchRun, str]:
    """Watches until Ctrl-C or for a duration in s.

    Args:
        console: where to say what is seen.
        prepared: whose station this is.
        with_cell: whether to start a virtual cell.
        empty: how many of the first sets of images show the empty cell.
        duration: s; None until somebody ends it.

    Returns:
        The run, and why it ended by itself; empty if it did not.

    Raises:
        KeyboardInterrupt: if somebody ended it before anybody looked.
        SimulationError: if the station is not there.
        ValueError: if the scenario has no whole images, or a part refuses its configuration.
    """
    scenario, robot = prepared.scenario, prepared.robot
    if not scenario.station.overview.enabled:
        raise ValueError(
            "watch: no camera of the scenario takes images of the whole cell; use --scenario cell-watched or "
            "--set station.overview.enabled=true"
        )
    console.print(f"{ADVICE}. Ctrl-C ends it with the report")
    with (
        asking() as end,
        station_clients(scenario, robot, with_cell, needs_camera=False) as station,
        _Teller(console) as teller,
    ):
        watch = LiveWatch(
            scenario,
            robot,
            station.client,
            teller.tell,
            lambda time: end.is_asked() or (duration is not None and time >= duration),
        )
        try:
            return watch.run(WatchProcess(partial(lookout, scenario, robot)), empty), watch.problem
        except EndedOnRequest:
            raise KeyboardInterrupt from None

"""What the record and a live view cost a guided run: ``python -m experiments.bench.guided.recording``.

A virtual cell is guided over loopback in real time, in turn without a record and with one on disk that a
Foxglove server passes on to a viewer which has subscribed to everything. A tick is written after its reply
has left: what makes the next reply later is that the processor was busy with something else.
"""

import itertools
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import websocket

from diagrams.record.foxglove_server import FoxgloveServer
from diagrams.record.run_record import RunRecord
from diagrams.scenario.scenario import load_scenario, scenario_text
from experiments.bench.wire import LAW, PATIENT
from experiments.cli.console import progress_bar
from experiments.station.guided import compare_on_station
from robots.description.model import load_robot

_TURNS = 2
_ALLOWED = 0.05  # ms, by which the median may be later


def answer_times() -> dict[str, np.ndarray]:
    """Of all messages, in ms, without and with a record and a viewer.

    Raises:
        RuntimeError: if a run did not come to its end.
    """
    scenario = load_scenario("cell", [*PATIENT, "station.kind=egm"])
    robot = load_robot(scenario.robot)
    with tempfile.TemporaryDirectory(prefix="truetip-recording-") as folder:
        server = FoxgloveServer("127.0.0.1:0", robot)
        command = [sys.executable, "-m", __spec__.name, server.address]
        viewer = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

        def recording(law: str, number: int) -> RunRecord | None:
            path = Path(folder) / f"{number}.mcap"
            return RunRecord(path, scenario_text(scenario), server) if number % 2 == 0 else None

        with progress_bar(f"{2 * _TURNS} runs in real time") as progress:
            comparison = compare_on_station(
                scenario, robot, [LAW], 2 * _TURNS, True, progress, recording=recording
            )
        server.close()
        seen = int(viewer.communicate(timeout=30.0)[0])
    records = comparison.records[LAW]
    if seen < sum(len(record.turn_around) for record in records[1::2]):
        raise RuntimeError(f"the viewer was sent {seen} messages only")
    early = {record.ended for record in records} - {"path"}
    if early:
        raise RuntimeError(f"a run did not come to its end: {', '.join(early)}")
    return {
        name: 1e3 * np.concatenate([record.turn_around for record in records[first::2]])
        for first, name in enumerate(("without", "with"))
    }


def _view(address: str) -> None:
    """Subscribes to everything until the server closes, then prints how many messages came."""
    viewer = websocket.create_connection(address, subprotocols=["foxglove.sdk.v1"])
    numbers, count = itertools.count(), 0
    while data := viewer.recv():
        if isinstance(data, bytes):
            count += data[0] == 1
        elif (said := json.loads(data))["op"] == "advertise":
            rows = [{"id": next(numbers), "channelId": channel["id"]} for channel in said["channels"]]
            viewer.send(json.dumps({"op": "subscribe", "subscriptions": rows}))
    print(count)


def main() -> None:
    """Prints a line for each; exit code 1 if the record makes a reply later than is allowed."""
    times = answer_times()
    for name, each in times.items():
        median, late = np.percentile(each, [50, 99])
        print(f"{name:8s} median {median:.3f} ms, 99 % {late:.3f} ms, {len(each)} messages")
    later = float(np.median(times["with"]) - np.median(times["without"]))
    print(f"later by {later:+.3f} ms in the median, allowed {_ALLOWED:g} ms")
    sys.exit(later > _ALLOWED)


if __name__ == "__main__":
    _view(sys.argv[1]) if len(sys.argv) > 1 else main()

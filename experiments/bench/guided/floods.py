"""A flood of strangers' datagrams while a robot is guided: ``python -m experiments.bench.guided.floods``.

A client guides a virtual cell over loopback along a slow circle. Two seconds into it a fourth process sends
20,000 spoiled messages a second for 20 s to the client's port, to the cell's, or to that of its camera. For
each the table says how many went out, how the client ended, how near the robot came to its limits of speed
and acceleration, and by how much the memory of the two grew while it lasted.
"""

import os
import random
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from experiments.bench.guided.memory import resident
from experiments.bench.guided.three_processes import Outcome, ThreeProcesses
from experiments.cli.console import progress_bar
from robots.description.model import load_robot
from systems.link.abb.controller import EgmRunConfig, VirtualController
from systems.link.abb.messages import Command, Mode, encode_command
from systems.link.qualisys.messages import PacketType, text_packet

WHOM = ("client", "cell", "camera")
_RATE, _SECONDS = 20_000, 20.0
_SLOW = ("reference.path=circle", "reference.acceleration=0.012", "reference.settle=1", "reference.dwell=1")
_BATCH = 20  # datagrams between two looks at the clock
_CONTENTS = 500  # different ones


def run_case(folder: Path, whom: str, seconds: float = _SECONDS) -> tuple[int, Outcome, dict[str, float]]:
    """Floods one of them.

    Returns:
        How many datagrams went out, how it ended, and by how many MB client and cell grew.

    Raises:
        RuntimeError: if they do not come to the path.
    """
    with ThreeProcesses(folder, _SLOW, patience=120.0) as three:
        three.wait_for_path()
        pids = {who: three.processes[who].pid for who in ("client", "cell")}
        ports = [three.camera_port] if whom == "camera" else udp_ports(pids[whom])
        before = {who: resident(pid) for who, pid in pids.items()}
        words = ["tcp" if whom == "camera" else "udp", str(seconds), *map(str, ports)]
        flood = subprocess.run(
            [sys.executable, "-m", __spec__.name, "flood", *words], capture_output=True, text=True, check=True
        )
        grown = {who: resident(pid) - before[who] for who, pid in pids.items()}
        said = three.client_end()
        time.sleep(1.0)
        three.end("cell")
    return int(flood.stdout), three.outcome(said), grown


def _spoiled(rng: random.Random) -> list[bytes]:
    """Messages of all wires with a few bits flipped, some of them cut off, and bytes of chance."""
    q = np.full(6, 0.1)
    controller = VirtualController(load_robot("irb1200"), EgmRunConfig())
    words = ("StreamFrames AllFrames 6D", "GetParameters All", "GetState", "Version 1.25")
    seeds = [
        *(encode_command(mode, Command(q, q), 5, 1.0) for mode in (Mode.JOINT, Mode.JOINT_SPEED)),
        *(controller.report(1000.0 + number, q, q, q) for number in range(5)),
        *(text_packet(PacketType.COMMAND, text) for text in words),
        rng.randbytes(60),
    ]
    contents = []
    for _ in range(_CONTENTS):
        data = bytearray(rng.choice(seeds))
        for _ in range(rng.randrange(4)):
            bit = rng.randrange(8 * len(data))
            data[bit // 8] ^= 1 << bit % 8
        contents.append(bytes(data[: rng.randrange(1, len(data))] if rng.random() < 0.1 else data))
    return contents


def udp_ports(process: int) -> list[int]:
    """The UDP ports of this machine that a process listens on."""
    links = (os.readlink(entry) for entry in Path(f"/proc/{process}/fd").iterdir())
    inodes = {link[8:-1] for link in links if link.startswith("socket:")}
    rows = [line.split() for line in Path("/proc/net/udp").read_text().splitlines()[1:]]
    return [int(row[1].partition(":")[2], 16) for row in rows if row[9] in inodes]


def _connected(kind: str, port: int) -> socket.socket:
    sender = socket.socket(socket.AF_INET, socket.SOCK_STREAM if kind == "tcp" else socket.SOCK_DGRAM)
    sender.settimeout(1.0)
    with suppress(OSError):
        sender.connect(("127.0.0.1", port))
    sender.setblocking(False)
    return sender


def _flood(kind: str, seconds: float, ports: list[int]) -> None:
    """Sends at the rate, or as fast as this machine and the other end can, and prints how many went out."""
    contents = _spoiled(random.Random(0))
    senders = [_connected(kind, port) for port in ports]
    sent, tried, began = 0, 0, time.monotonic()
    while (passed := time.monotonic() - began) < seconds:
        if tried > _RATE * passed:
            time.sleep(_BATCH / _RATE)
            continue
        at = tried // _BATCH % len(senders)
        for data in contents[tried % _CONTENTS : tried % _CONTENTS + _BATCH]:
            try:
                sent += senders[at].send(data) > 0
            except BlockingIOError:  # the other end does not read so fast
                break
            except OSError:  # it has closed the connection
                senders[at].close()
                senders[at] = _connected(kind, ports[at])
        tried += _BATCH
    print(sent)


def main(chosen: list[str]) -> None:
    """Floods those that are named, or all, and prints the table."""
    table = Table(box=box.SIMPLE_HEAD)
    names = (
        "flooded",
        "messages",
        "the client ended with",
        "recorded",
        "commands",
        "links",
        "client",
        "cell",
    )
    for name in names:
        table.add_column(name, overflow="fold")
    cases = [whom for whom in WHOM if not chosen or whom in chosen]
    with progress_bar(f"{len(cases)} floods of {_SECONDS:g} s") as progress:
        for number, whom in enumerate(cases):
            with tempfile.TemporaryDirectory(prefix="truetip-floods-") as folder:
                sent, outcome, grown = run_case(Path(folder), whom)
            shares = [
                "/".join(f"{share:.2f}" for share in pair) for pair in (outcome.commands, outcome.links)
            ]
            sizes = [f"{grown[who]:+.1f} MB" for who in ("client", "cell")]
            table.add_row(whom, str(sent), outcome.ended, f"{outcome.recorded:.1f} s", *shares, *sizes)
            progress((number + 1) / len(cases))
    Console(width=None if sys.stdout.isatty() else 160).print(table)
    print("commands and links: largest shares of the limits of speed / acceleration")


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    if sys.argv[1:2] == ["flood"]:
        _flood(sys.argv[2], float(sys.argv[3]), [int(port) for port in sys.argv[4:]])
    else:
        main(sys.argv[1:])

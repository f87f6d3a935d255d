"""Clients that others wrote move the virtual robot: each in a process of its own, over loopback."""

import json
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from diagrams.runs.cell_loop import CellLoop
from diagrams.scenario.scenario import load_scenario
from robots.description.model import load_robot
from systems.link.udp_channel import UdpChannel

pytestmark = pytest.mark.real_time

CLIENT = Path(__file__).parents[1] / "systems" / "link" / "abb" / "foreign_client.py"


def moved_by(package: str, mode: str) -> dict:
    """What a foreign client says of a robot that it has moved."""
    with UdpChannel() as free:
        port = free.address[1]
    command = [sys.executable, str(CLIENT), package, str(port), mode]
    client = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert client.stdout is not None
    assert client.stdout.readline().strip() == "listening"
    # A busy machine may keep the client from answering for a while.
    scenario = load_scenario("cell", ["station.link.run.timeout=5"])
    loop = CellLoop(scenario, load_robot("irb1200"), ("127.0.0.1", port), with_log=False)
    finished = threading.Event()
    waiter = threading.Thread(target=lambda: (client.wait(60.0), finished.set()))
    waiter.start()
    loop.run(lambda time: finished.is_set() or time > 30.0)
    waiter.join()
    loop.close()
    output, problem = client.communicate()
    assert client.returncode == 0, problem
    return json.loads(output.splitlines()[-1])


@pytest.mark.slow
@pytest.mark.parametrize("package", ["ABBRobotEGM", "abb_robot_client"])
@pytest.mark.parametrize(
    ("mode", "what", "expected", "within"),
    [
        ("joint", "joints", [2.0, 0.0, -1.0, 0.0, 0.0, 3.0], 0.02),
        # For a second, to a few of the client's answers that the machine may bring late.
        ("speed", "joints", [1.5, 0.0, 0.0, 0.0, 0.0, -2.0], 0.1),
        ("pose", "tool", [0.0, 10.0, 5.0], 0.05),
    ],
)
def test_a_foreign_client_moves_the_robot(package: str, mode: str, what: str, expected, within: float):
    result = moved_by(package, mode)
    np.testing.assert_allclose(result[what], expected, atol=within)
    assert result["running"]

"""The virtual cell obeys one client: strangers are counted, and nothing that they send moves it."""

import numpy as np
import pytest

from diagrams.runs.cell_loop import CellLoop
from diagrams.scenario.scenario import load_scenario
from robots.description.model import load_robot
from systems.link.abb.messages import Command, Mode, encode_command
from systems.link.udp_channel import UdpChannel

HERE = "127.0.0.1"


class Rig:
    """A cell whose clock stands still, a client and a stranger."""

    def __init__(self, **options) -> None:
        self.said: list[str] = []
        self.client, self.stranger = UdpChannel(), UdpChannel()
        robot = load_robot("irb1200")
        self.loop = CellLoop(
            load_scenario("cell"), robot, (HERE, 1), with_log=False, tell=self.said.append, **options
        )
        self.start, self.number = self.loop.cell.planned, 0

    def hear(
        self, sender: UdpChannel, data: bytes | None = None, offset: float = 0.0, now: float = 0.0
    ) -> None:
        """A command to a place beside the start, or other bytes; ``now`` in s of the cell."""
        self.number += 1
        command = Command(position=self.start + offset)
        sender.send(data or encode_command(Mode.JOINT, command, self.number, 0.0), self.loop._channel.address)
        assert self.loop._channel.wait(5.0)
        self.loop._hear(now)

    @property
    def reference(self) -> float:
        """Of joint 1, from where it began, in rad."""
        return float(self.loop.controller.references[0][0] - self.start[0])

    def __enter__(self) -> "Rig":
        return self

    def __exit__(self, *_: object) -> None:
        for end in (self.client, self.stranger, self.loop):
            end.close()


def test_the_first_that_sends_a_command_is_obeyed_and_nobody_else():
    with Rig() as rig:
        rig.hear(rig.stranger, b"no command")  # which makes nobody the client
        rig.hear(rig.client, offset=0.01)
        rig.hear(rig.stranger, offset=0.5)
        assert rig.reference == pytest.approx(0.01)
        assert rig.loop.statistics.strangers == 1
        address, port = rig.client.address
        assert rig.said == [f"obeys {address}:{port}"]


def test_after_a_silence_another_one_may():
    with Rig() as rig:
        rig.hear(rig.client, offset=0.01)
        rig.hear(rig.stranger, offset=0.02, now=3.0)
        assert rig.reference == pytest.approx(0.02)
        assert rig.loop.statistics.strangers == 0


def test_one_machine_may_be_named():
    with Rig(peer="192.0.2.7") as rig:
        rig.hear(rig.client, offset=0.01)
        assert np.isnan(rig.reference)
        assert rig.loop.statistics.strangers == 1

# A None where there should be something fails a test as it should.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportAttributeAccessIssue=false
"""Sockets on loopback: what waits, what counts, and where one may listen."""

import numpy as np
import pytest

from systems.link.abb.client import EgmClient
from systems.link.abb.messages import Command, Mode
from systems.link.udp_channel import Buffering, ChannelError, UdpChannel, ipv4_address
from tests.systems.link.abb.reports import PERIOD, SPEED, report


@pytest.mark.parametrize(
    ("buffering", "first", "second"),
    [
        (Buffering.NEXT, [b"0"], [b"1"]),
        (Buffering.NEWEST, [b"0", b"1", b"2"], []),
        (Buffering.CLEAR_ONCE, [], [b"3"]),
    ],
)
def test_what_waits_is_read_as_table_a_5_says(buffering, first, second):
    with UdpChannel(buffering=buffering) as ours, UdpChannel() as theirs:
        for number in range(3):
            theirs.send(b"%d" % number, ours.address)
        ours.wait(1.0)
        assert [data for data, _ in ours.receive()] == first
        if buffering is Buffering.CLEAR_ONCE:
            theirs.send(b"3", ours.address)
            ours.wait(1.0)
        assert [data for data, _ in ours.receive()] == second


def test_one_listens_on_this_machine_alone_unless_told_otherwise():
    with UdpChannel() as channel:
        assert channel.address[0] == "127.0.0.1"


def test_a_port_that_is_taken_or_an_address_of_another_machine_is_refused():
    with UdpChannel() as channel, pytest.raises(ChannelError, match=r"cannot listen on UDP 127\.0\.0\.1"):
        UdpChannel(channel.address[1])
    with pytest.raises(ChannelError, match=r"cannot listen on UDP 203\.0\.113\.1"):
        UdpChannel(0, "203.0.113.1")


def test_a_client_answers_the_newest_of_what_has_piled_up():
    with EgmClient(SPEED, period=PERIOD) as client, UdpChannel() as controller:
        for number in range(1, 6):
            controller.send(report(number), client.channel.address)
        assert client.poll(1.0).seqno == 5
        assert client.session.counters.superseded == 4
        assert client.reply(Mode.JOINT, Command(client.session.last.position))
        assert not client.reply(Mode.JOINT, Command(client.session.last.position))
        assert controller.wait(1.0)
        assert len(controller.receive()) == 1


def test_a_reply_to_a_program_that_has_gone_does_not_disturb():
    with EgmClient(SPEED, period=PERIOD) as client:
        with UdpChannel() as controller:
            controller.send(report(1), client.channel.address)
            client.poll(1.0)
        client.reply(Mode.JOINT, Command(client.session.last.position))
        assert client.poll(0.02) is None


def test_why_commands_start_anew_is_told_though_the_next_message_was_there_already():
    """Messages come in bursts: those that were refused, the one that is believed, and one that follows it."""
    with EgmClient(SPEED, period=PERIOD) as client, UdpChannel() as controller:
        controller.send(report(1), client.channel.address)
        client.poll(1.0)
        for number in range(2, 9):
            controller.send(report(number, np.full(6, 0.7)), client.channel.address)
        epoch = client.session.epoch
        assert client.poll(1.0).seqno == 8
        assert client.session.epoch > epoch
        assert client.session.trouble.startswith("a joint jumped by 40.1 degrees")
        controller.send(report(9, np.full(6, 0.7)), client.channel.address)
        client.poll(1.0)
        assert client.session.trouble == ""


def test_a_machine_may_be_named_and_one_without_an_address_is_refused():
    assert ipv4_address("the controller", "localhost") == "127.0.0.1"
    for unknown in ("::1", "nobody.invalid"):
        with pytest.raises(ChannelError, match=f"the controller: no IPv4 address is known for '{unknown}'"):
            ipv4_address("the controller", unknown)

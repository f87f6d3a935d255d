# A None where there should be something fails a test as it should.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportAttributeAccessIssue=false
"""Sockets on loopback: what waits, what counts, and where one may listen."""

import pytest

from systems.link.abb.client import EgmClient
from systems.link.abb.messages import Command, Mode
from systems.link.udp_channel import Buffering, ChannelError, UdpChannel
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

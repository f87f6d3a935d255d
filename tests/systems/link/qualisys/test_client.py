"""The client against bytes written by hand, and against everything that a network does."""

import socket
import sys
import time

import numpy as np
import pytest

from systems.link.qualisys.client import MocapClient, MocapConfig
from systems.link.qualisys.conversation import MocapError, State
from systems.link.qualisys.server import CameraServerConfig, VirtualCameraServer
from tests.systems.link.qualisys.test_messages import mutated
from tests.systems.link.qualisys.wire import (
    COMMAND,
    ERROR,
    EVENT,
    NO_MORE_DATA,
    TURNED,
    XML,
    XML_PACKET,
    by_hand,
    data_by_hand,
    pose,
    say,
    scripted,
    until,
)

pytestmark = pytest.mark.real_time

GREETING = say(COMMAND, "QTM RT Interface connected.")  # with a full stop, as some versions greet
HANDSHAKE = [GREETING, say(COMMAND, "Version set to 1.25"), say(XML_PACKET, XML)]


def config(port: int, **change) -> MocapConfig:
    return MocapConfig(**{"port": port, "timeout": 5.0, "retry": 0.05} | change)


def collect(client: MocapClient, count: int) -> list:
    arrivals = []
    until(lambda: len(arrivals.extend(client.poll()) or arrivals) >= count)
    return arrivals


def test_a_recorded_conversation_is_understood_and_answered_as_documented():
    frames = by_hand(NO_MORE_DATA) + data_by_hand(4000, 1, [(TURNED, 0.5)]) + data_by_hand(8000, 2, [None])
    with scripted([*HANDSHAKE, frames, b""]) as server:
        with MocapClient(config(server.port, transport="tcp")) as client:
            first, second = (arrival.frame for arrival in collect(client, 2))
            np.testing.assert_allclose(pose(first, client.place(first)), TURNED.GetAsMatrix4(), atol=1e-7)
            assert (first.time_us, first.residual(0), second.pose(0)) == (4000, pytest.approx(5e-4), None)
            assert (client.version, client.counters.no_more_data) == ("1.25", 1)
        until(lambda: len(server.commands) == 4)
        asked = ["Version 1.25", "GetParameters 6D", "StreamFrames AllFrames 6DRes", "StreamFrames Stop"]
        assert server.commands[:4] == asked


def test_an_old_server_is_asked_for_older_versions():
    refusal = say(ERROR, "Version NOT supported")
    with scripted([GREETING, refusal, refusal, say(COMMAND, "Version set to 1.17"), b""]) as server:
        with MocapClient(config(server.port)) as client:
            until(lambda: client.poll() is not None and client.state is State.PARAMETERS)
            assert client.version == "1.17"
        until(lambda: len(server.commands) == 4)
        assert server.commands == ["Version 1.25", "Version 1.21", "Version 1.17", "GetParameters 6D"]


@pytest.mark.parametrize(
    ("pieces", "message"),
    [
        ([say(COMMAND, "220 mail.example.com")], "not a Qualisys server: it says '220 mail.example.com'"),
        ([b"SSH-2.0-OpenSSH"], "packet: states .* bytes"),
        ([say(ERROR, "Connection refused. Max number of clients reached.")], "Max number of clients reached"),
        ([GREETING, *[say(ERROR, "Version NOT supported")] * 5], "speaks none of the versions 1.25, 1.21"),
        ([*HANDSHAKE[:2], say(ERROR, "Parameters not available")], "says 'Parameters not available'"),
        ([*HANDSHAKE[:2], say(XML_PACKET, XML.replace("tool", "hand"))], "it tracks 'hand'"),
        ([*HANDSHAKE[:2], say(XML_PACKET, "<")], "6D parameters: no XML"),
        ([*HANDSHAKE, say(ERROR, "Parse error")], "says 'Parse error'"),
        ([GREETING], r"no answer within 0.4 s \(agreeing on a version\)"),
        ([GREETING, b""], r"no answer within 0.4 s"),
    ],
)
def test_a_server_of_no_use_is_reported_by_name(pieces: list[bytes], message: str):
    with scripted([*pieces, b"", b""]) as server, MocapClient(config(server.port, timeout=0.4)) as client:
        until(lambda: client.poll() is None or client.last_error)
        with pytest.raises(MocapError, match=rf"camera server 127.0.0.1:{server.port}: .*{message}"):
            client.wait(0.0)


def test_a_server_that_is_not_there_is_waited_for_without_blocking():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with MocapClient(config(port)) as client:
        with pytest.raises(MocapError, match="cannot be reached: connection refused"):
            client.wait(0.1)
        with VirtualCameraServer(CameraServerConfig(port=port)) as server:
            client.wait(5.0)
            until(lambda: server.streams == 1)


@pytest.fixture
def server():
    with VirtualCameraServer(CameraServerConfig(["Base", "Tool"], port=0)) as running:
        yield running


@pytest.mark.parametrize("transport", ["udp", "tcp"])
@pytest.mark.parametrize("component", ["6D", "6DRes"])
def test_frames_of_our_own_server_arrive(server: VirtualCameraServer, transport: str, component: str):
    with MocapClient(config(server.port, transport=transport, component=component)) as client:
        client.wait(5.0)
        until(lambda: server.streams)
        for number in range(50):
            server.publish(4000 * number, number, {"Tool": TURNED}, {"Tool": 1e-4})
        frames = [arrival.frame for arrival in collect(client, 50)]
        assert [frame.time_us for frame in frames] == [4000 * number for number in range(50)]
        assert client.place(frames[0]) == 1  # its name is written otherwise than ours
        np.testing.assert_allclose(pose(frames[0], 1), TURNED.GetAsMatrix4(), atol=1e-7)
        assert frames[0].residual(1) == pytest.approx(1e-4 if component == "6DRes" else 0.0)
        assert client.counters.frames == 50


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not say when a datagram came")
def test_the_age_of_a_frame_is_how_long_it_waited_for_the_poll(server: VirtualCameraServer):
    with MocapClient(config(server.port)) as client:
        client.wait(5.0)
        until(lambda: server.streams)
        before = time.monotonic()
        server.publish(4000, 1, {})
        published = time.monotonic()
        time.sleep(0.05)
        polled = time.monotonic()
        (arrival,) = client.poll()
        # It came during the publication; the poll began at most a moment after ``polled``.
        assert polled - published - 1e-3 < arrival.age < time.monotonic() - before + 1e-3


def test_a_server_that_goes_and_returns_is_noticed_reported_and_found_again(server: VirtualCameraServer):
    port = server.port
    with MocapClient(config(port)) as client:
        client.wait(5.0)
        server.close()
        until(lambda: client.poll() is None or client.state is State.DISCONNECTED)
        assert client.last_error == "the server has closed the connection"
        with VirtualCameraServer(CameraServerConfig(["Base", "Tool"], port=port)) as again:
            client.wait(5.0)
            until(lambda: again.streams)
            again.publish(0, 0, {"Tool": TURNED})
            assert len(collect(client, 1)) == 1
        assert (client.counters.connections, client.counters.disconnections) == (2, 1)
        assert client.last_error == "" or client.state is not State.STREAMING


def test_an_idle_server_that_lives_is_kept_and_a_dead_line_is_given_up(server: VirtualCameraServer):
    """The live one answers GetState; the scripted one stays connected and says nothing more."""
    with MocapClient(config(server.port, timeout=0.25)) as client, scripted([*HANDSHAKE, b"", b""]) as dead:
        client.wait(5.0)
        with MocapClient(config(dead.port, timeout=0.25, retry=10.0)) as other:
            other.wait(5.0)
            until(lambda: client.poll() is None or other.poll() is None or other.last_error)
            assert other.last_error.startswith("silent for 0.5")
        assert (client.state, client.counters.disconnections) == (State.STREAMING, 0)


def test_bodies_that_change_during_the_measurement_are_asked_for_again():
    changed = XML.replace("<Body>", "<Body><Name>new</Name></Body><Body>", 1)
    two = data_by_hand(4000, 1, [None, (TURNED, 0.1)])
    pieces = [*HANDSHAKE, two + by_hand(EVENT, b"\x0b"), say(XML_PACKET, changed), b""]
    with scripted(pieces) as server, MocapClient(config(server.port, transport="tcp")) as client:
        (arrival,) = collect(client, 1)
        assert client.place(arrival.frame) is None
        until(lambda: client.poll() is None or client.place(arrival.frame) == 1)


def test_bodies_that_are_not_enabled_may_be_missing_from_the_frames():
    off = "<Body><Name>off</Name><Enabled>false</Enabled></Body>"
    xml = XML.replace("<Body>", off + "<Body>", 1)
    frames = data_by_hand(1, 1, [(TURNED, 0.1)]) + data_by_hand(2, 2, [None, (TURNED, 0.1)])
    pieces = [*HANDSHAKE[:2], say(XML_PACKET, xml), frames, b""]
    with scripted(pieces) as server, MocapClient(config(server.port, transport="tcp")) as client:
        assert [client.place(arrival.frame) for arrival in collect(client, 2)] == [0, 1]


def test_garbage_and_strangers_are_counted_and_change_nothing():
    """3000 spoiled datagrams from the server's own port, and good ones from another."""
    rng = np.random.default_rng(0)
    good = data_by_hand(4000, 1, [(TURNED, 0.1), None])
    spoiled = [data for data in (mutated(rng, good) for _ in range(3000)) if not is_frame(data, good)]
    sends = []
    server = VirtualCameraServer(CameraServerConfig(port=0), disturb=lambda send: sends.append(send) or send)
    with server, MocapClient(config(server.port)) as client:
        client.wait(5.0)
        until(lambda: server.streams)
        server.publish(4000, 1, {"tool": TURNED})
        collect(client, 1)
        own, before = ("127.0.0.1", client.udp_port), client.counters.no_more_data
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            for _ in range(100):
                stranger.sendto(good, own)
        for data in spoiled:
            sends[0](data, own)
            assert client.poll() == []
        server.publish(8000, 2, {"tool": TURNED})
        assert collect(client, 1)[0].frame.time_us == 8000
        assert client.counters.wrong_sender == 100
        assert client.counters.garbage + client.counters.no_more_data - before == len(spoiled)
        assert (client.state, client.counters.frames) == (State.STREAMING, 2)


def is_frame(data: bytes, good: bytes) -> bool:
    """What cannot be told from a good datagram: it is as long and differs only in stamps and numbers."""
    return len(data) == len(good) and data[:8] == good[:8] and data[20:36] == good[20:36]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"transport": "pigeon"}, "transport must be udp or tcp, got 'pigeon'"),
        ({"component": "6DEuler"}, "component must be 6D or 6DRes, got '6DEuler'"),
        ({"port": 0}, "port must be 1 to 65535 and udp_port 0 to 65535, got 0 and 0"),
        ({"frequency": 0}, "frequency must be 1 Hz or more, got 0"),
        ({"timeout": 0.0}, "timeout and retry must be positive, got 0.0 s and 1.0 s"),
        ({"body": " "}, "the name of the body is missing"),
        ({"address": "camera.invalid"}, "no IPv4 address is known for 'camera.invalid'"),
    ],
)
def test_refuses_a_configuration_that_cannot_work(change: dict, message: str):
    with pytest.raises(ValueError, match=f"camera server: {message}"):
        MocapClient(MocapConfig(**change))

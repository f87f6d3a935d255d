"""The virtual camera, seen by the official client in a process of its own, and by raw bytes."""

import json
import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from systems.link.qualisys.parameters import parse_bodies
from systems.link.qualisys.server import CameraServerConfig, VirtualCameraServer
from tests.systems.link.qualisys.wire import COMMAND, NO_MORE_DATA, TURNED, by_hand, data_by_hand, say, until

pytestmark = pytest.mark.real_time

BODIES = ["Base", "Werkzeug & Flansch", "lost"]
OFFICIAL_CLIENT = Path(__file__).with_name("qtm_rt_client.py")


def publish_until(server: VirtualCameraServer, done: threading.Event) -> None:
    """4 ms frames of a moving body, a resting one, and one that the cameras never see."""
    number = 0
    while not done.is_set():
        number += 1
        moving = RigidTransform(TURNED.rotation(), [1e-3 * number, 0.2, 0.3])
        server.publish(4000 * number, number, {"Base": moving, BODIES[1]: TURNED}, {"Base": 0.2e-3})
        time.sleep(4e-3)


@pytest.fixture(scope="module")
def official() -> dict:
    """Everything the official client got, by the name of the question."""
    heard, done = {}, threading.Event()
    with VirtualCameraServer(CameraServerConfig(BODIES, port=0)) as server:
        publisher = threading.Thread(target=publish_until, args=(server, done))
        command = [sys.executable, str(OFFICIAL_CLIENT), str(server.port), "20"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                assert process.stdout is not None
                for line in process.stdout:
                    heard |= json.loads(line)
                    if heard.get("stage") == "tcp" and not publisher.is_alive():
                        publisher.start()  # the first questions were asked of an idle camera
                assert process.wait(10.0) == 0
            finally:
                process.kill()
                done.set()
        publisher.join()
    return heard


def test_the_official_client_learns_state_version_byte_order_and_bodies(official: dict):
    assert official["state idle"] == "EventConnectionClosed"
    assert official["state measuring"] == "EventConnected"
    assert official["version"].startswith("QTM Version is ")
    assert official["byte order"] == "Byte order is little endian"
    assert [body.name for body in parse_bodies(official["parameters"])] == BODIES


@pytest.mark.parametrize("way", ["tcp", "udp"])
def test_the_official_client_streams_every_frame_with_its_stamp_and_residual(official: dict, way: str):
    numbers = [frame["number"] for frame in official[way]]
    assert numbers == list(range(numbers[0], numbers[0] + 20))
    for frame in official[way]:
        assert frame["time"] == 4000 * frame["number"]
        moving, resting, lost = frame["bodies"]
        assert moving[0] == frame["number"]  # 1 mm a frame
        np.testing.assert_allclose(moving[1:3], [200.0, 300.0], rtol=1e-6)
        assert (moving[12], resting[12]) == (pytest.approx(0.2), 0.0)
        assert lost == [None] * 13


def test_the_official_client_reads_the_rotation_column_by_column(official: dict):
    for nine in (body[3:12] for body in official["frame"]["bodies"][:2]):
        matrix = np.reshape(nine, (3, 3), order="F")
        np.testing.assert_allclose(matrix, TURNED.rotation().matrix(), rtol=0.0, atol=1e-7)


class Raw:
    """A client of bytes and nothing else."""

    def __init__(self, server: VirtualCameraServer) -> None:
        self.socket = socket.create_connection(("127.0.0.1", server.port), timeout=5.0)
        self.greeting = self.read()

    def read(self) -> tuple[int, bytes]:
        header = self.socket.recv(8, socket.MSG_WAITALL)
        size, kind = struct.unpack("<II", header)
        return kind, self.socket.recv(size - 8, socket.MSG_WAITALL) if size > 8 else b""

    def ask(self, text: str) -> tuple[int, bytes]:
        self.socket.sendall(say(COMMAND, text))
        return self.read()


@pytest.fixture
def server():
    with VirtualCameraServer(CameraServerConfig(["tool"], port=0)) as running:
        yield running


@pytest.fixture
def connect(server: VirtualCameraServer):
    """Makes clients, and closes them in the end."""
    made = []

    def make() -> Raw:
        made.append(Raw(server))
        return made[-1]

    yield make
    for client in made:
        client.socket.close()


def test_it_greets_without_a_full_stop(connect):
    assert connect().greeting == (1, b"QTM RT Interface connected\0")


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        ("Version", (1, b"Version is 1.1\0")),
        ("vErSiOn 1.8", (1, b"Version set to 1.8\0")),
        ("version 1.7", (0, b"Version NOT supported\0")),
        ("version 9.9", (0, b"Version NOT supported\0")),
        ("version 1.²", (0, b"Version NOT supported\0")),
        ("BYTEORDER", (1, b"Byte order is little endian\0")),
        ("GetState", (6, b"\2")),
        ("GetCurrentFrame 6D", (4, b"")),
        ("StreamFrames AllFrames 6D", (4, b"")),
        ("GetParameters 3D", (0, b"Parameters not available\0")),
        ("GetCurrentFrame 7D", (0, b"Parse error\0")),
        ("StreamFrames AllFrames UDP:8.8.8.8:4444 6D", (0, b"UDP address is not that of the client\0")),
        ("open the pod bay doors", (0, b"Parse error\0")),
        ("", (0, b"Parse error\0")),
    ],
)
def test_an_idle_camera_answers(connect, command: str, answer: tuple[int, bytes]):
    assert connect().ask(command) == answer


def test_stop_has_no_answer_and_ends_the_stream(server: VirtualCameraServer, connect):
    client = connect()
    client.ask("streamframes allframes 6d")
    assert server.streams == 1
    client.socket.sendall(say(COMMAND, "streamframes stop"))
    assert client.ask("byteorder") == (1, b"Byte order is little endian\0")
    assert server.streams == 0


def test_a_measurement_begins_with_the_first_frame_and_its_end_is_told(server: VirtualCameraServer, connect):
    client = connect()
    assert client.ask("streamframes allframes 6dres")[0] == NO_MORE_DATA
    server.publish(4000, 1, {"tool": TURNED})
    assert client.read() == (6, b"\1")
    assert by_hand(*client.read()) == data_by_hand(4000, 1, [(TURNED, 0.0)])
    server.finish()
    assert client.read() == (6, b"\2")
    assert client.read() == (NO_MORE_DATA, b"")


@pytest.mark.parametrize(
    ("rate", "numbers"),
    [
        ("AllFrames", list(range(1, 26))),
        ("FrequencyDivisor:10", [1, 11, 21]),
        ("Frequency:100", [1, 4, 6, 9, 11, 14, 16, 19, 21, 24]),  # of 250 Hz: 2.5 frames apart
        ("Frequency:1000", list(range(1, 26))),
    ],
)
def test_a_client_gets_the_rate_that_it_asks_for(
    server: VirtualCameraServer, connect, rate: str, numbers: list[int]
):
    client = connect()
    server.publish(0, 0, {})
    assert client.read()[0] == 6
    client.socket.sendall(say(COMMAND, f"streamframes {rate} 6d"))
    until(lambda: server.streams)
    for number in range(1, 26):
        server.publish(4000 * number, number, {"tool": TURNED})
    found = [struct.unpack("<QI", client.read()[1][:12])[1] for _ in numbers]
    assert found == numbers


def test_a_rate_holds_when_a_measurement_begins_anew(server: VirtualCameraServer, connect):
    client = connect()
    assert client.ask("streamframes frequency:125 6d")[0] == NO_MORE_DATA
    for number in [*range(1001, 1007), *range(1, 7)]:  # at 250 Hz; the stamps go back by four seconds
        server.publish(4000 * number, number, {"tool": TURNED})
    assert client.read()[0] == 6
    found = [struct.unpack("<QI", client.read()[1][:12])[1] for _ in range(6)]
    assert found == [1001, 1003, 1005, 1, 3, 5]


@pytest.mark.slow
def test_several_clients_are_served_and_one_that_does_not_read_holds_up_nobody(
    server: VirtualCameraServer, connect
):
    reading, sleeping = connect(), connect()
    for client in (reading, sleeping):
        assert client.ask("streamframes allframes 6d")[0] == NO_MORE_DATA
    frames = 0
    while not server.left_out:  # the kernel takes some megabytes before it refuses
        frames += 1
        server.publish(frames, frames, {"tool": TURNED})
        if frames == 1:
            assert reading.read()[0] == 6
        assert struct.unpack("<QI", reading.read()[1][:12]) == (frames, frames)
        assert frames < 1_000_000


def test_garbage_cuts_off_only_who_sent_it(server: VirtualCameraServer, connect):
    good, bad = connect(), connect()
    bad.socket.sendall(b"GET / HTTP/1.1\r\n\r\n")
    assert bad.socket.recv(1) == b""
    assert good.ask("byteorder")[0] == COMMAND
    until(lambda: server.clients == 1)


def test_an_eleventh_client_is_refused(connect):
    clients = [connect() for _ in range(11)]
    assert [client.greeting[0] for client in clients] == [1] * 10 + [0]
    assert b"Max number of clients" in clients[10].greeting[1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"address": "0.0.0.0"}, "would listen to every network; give the address of one interface"),
        ({"address": ""}, "'' is no IPv4 address of an interface"),
        ({"address": "camera.invalid"}, "is no IPv4 address"),
        ({"bodies": []}, r"bodies must be distinct names, got \[\]"),
        ({"bodies": ["a", "a"]}, "bodies must be distinct names"),
        ({"port": 65536}, "port must be 0 to 65535, got 65536"),
        ({"frequency": 0}, "frequency must be 1 Hz or more, got 0"),
    ],
)
def test_refuses_what_no_camera_can_be(change: dict, message: str):
    with pytest.raises(ValueError, match=f"virtual camera: .*{message}"):
        VirtualCameraServer(CameraServerConfig(**change))


def test_it_listens_on_loopback_only(server: VirtualCameraServer):
    assert server.address[0] == "127.0.0.1"


def test_a_body_that_is_not_tracked_is_refused(server: VirtualCameraServer):
    with pytest.raises(ValueError, match="no such body: hand; it has tool"):
        server.publish(0, 0, {"hand": RigidTransform(RotationMatrix())})

"""Bytes of strangers: no decoder raises what it does not announce, takes long, or lets a robot be moved."""

import contextlib
import math
import random
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform

from robots.description.model import load_robot
from systems.link.abb.controller import EgmRunConfig, VirtualController
from systems.link.abb.messages import Command, EgmError, Mode, Pose, decode_report, encode_command
from systems.link.abb.schema import CORRECTION, EgmSensor
from systems.link.abb.session import EgmSession
from systems.link.abb.signals import SignalCodec, SignalError, SignalLayout
from systems.link.kuka.controller import RsiController, RsiRunConfig
from systems.link.kuka.robot_link import RsiCodec, RsiCommand, RsiReport
from systems.link.kuka.telegrams import (
    RobotTelegram,
    SensorTelegram,
    read_sensor,
    write_robot,
    write_sensor,
)
from systems.link.qualisys.conversation import Conversation, MocapError
from systems.link.qualisys.messages import (
    Component,
    PacketError,
    PacketStream,
    PacketType,
    decode_data,
    encode_data,
    packet,
    split_datagram,
    text_packet,
)
from systems.link.qualisys.parameters import ParameterError, bodies_xml, parameters_xml, parse_bodies
from systems.link.qualisys.session import CameraState, Session
from systems.link.qualisys.stream_request import StreamRequest
from systems.link.session import LinkSession
from tests.systems.link.abb.reports import HERE, SPEED, report

ROBOT = load_robot("irb1200")
CONTROLLER = VirtualController(ROBOT, EgmRunConfig())
RSI_CONTROLLER = RsiController(ROBOT, RsiRunConfig(restart_after=0.0))
Q = np.array([0.1, 0.2, 0.3, 0.1, 0.5, 0.2])
QUICK = 400  # datagrams of each decoder in every run of the tests
MANY = 40_000  # in the slow ones
CORPUS = Path(__file__).parent / "corpus"  # what has once been a problem, a file each, named by its decoder
LONGEST = 5e-3  # s of the processor's time


def commands() -> list[bytes]:
    pose = Pose(np.array([0.5, 0.1, 0.6]), np.array([0.0, 0.0, 1.0, 0.0]), np.array([0.1, 0.2, 0.3]))
    command = Command(Q, Q, pose, 0.01 * np.ones(6), 0.01 * np.ones(3))
    seeds = [encode_command(mode, command, 5, 1.0) for mode in Mode]
    return [
        *seeds,
        encode_command(Mode.POSE_QUAT_SPEED, Command(pose=pose, pose_velocity=0.1 * np.ones(7)), 5, 1.0),
    ]


def frames() -> list[bytes]:
    X_WB = np.array([RigidTransform([0.1, 0.2, 0.3]).GetAsMatrix4()] * 2)
    residual = np.array([1e-4, 2e-4])
    kinds = ((Component.POSE,), (Component.POSE_RESIDUAL,), (Component.POSE, Component.POSE_RESIDUAL))
    return [encode_data(10**6, 7, X_WB, residual, components) for components in kinds]


def talk() -> list[bytes]:
    words = ["Version 1.25", "GetParameters All", "StreamFrames AllFrames UDP:4545 6D", "StreamFrames Stop"]
    words += [f"StreamFrames Frequency:{'9' * digits} 6D" for digits in (1, 3, 400, 5000)]
    words += ["GetCurrentFrame 6DRes", "StreamFrames FrequencyDivisor:2 UDP:127.0.0.1:99999 6D", "GetState"]
    return [text_packet(PacketType.COMMAND, each) for each in words]


def answers() -> list[bytes]:
    texts = [
        "QTM RT Interface connected",
        "Version set to 1.25",
        parameters_xml("1.25", [bodies_xml(["tool"])]),
    ]
    kinds = [PacketType.COMMAND, PacketType.COMMAND, PacketType.XML]
    greeting = [text_packet(kind, text) for kind, text in zip(kinds, texts, strict=True)]
    return [
        *greeting,
        packet(PacketType.EVENT, b"\x01"),
        text_packet(PacketType.ERROR, "no"),
        b"".join(greeting),
    ]


def cell(data: bytes) -> None:
    """A command to a virtual controller; whatever it is, what is followed are numbers within the range."""
    # Started anew, so that it takes any number.
    CONTROLLER.stop(0.0)
    CONTROLLER.cycle(1.0, Q)
    if CONTROLLER.receive(data, 1.0, Q):
        reference, speed = CONTROLLER.references
        assert not (np.abs(reference) > 10.0).any()
        assert np.isfinite(speed).all() or np.isnan(speed).all()


def client(data: bytes) -> None:
    """A message of a controller to a client whose robot stands at zero: nothing moves it."""
    session = EgmSession(SPEED)
    session.receive(report(1), HERE, 0.0)
    found = session.receive(data, HERE, 4e-3)
    assert found is None or np.isfinite(found.position).all()
    reply = session.reply(Mode.JOINT, Command(np.zeros(6)), 4e-3)
    assert reply is None or isinstance(reply, bytes)


def telegrams() -> list[bytes]:
    """Of a controller under RSI."""
    correction = 0.001 * np.ones(6)
    return [
        write_robot(RobotTelegram(8, np.zeros(6), np.zeros(6), np.zeros(6), 0, correction)),
        write_robot(RobotTelegram(8, np.zeros(6), np.zeros(6), np.zeros(6), 0)),
    ]


def corrections() -> list[bytes]:
    """To a controller under RSI."""
    small = 1e-4 * np.ones(6)
    return [
        write_sensor(each)
        for each in (SensorTelegram(4, axes=small), SensorTelegram(4, pose=small), SensorTelegram(4))
    ]


def rsi_cell(data: bytes) -> None:
    """A correction to a virtual controller; what is followed is a number near where the program stands."""
    controller = RSI_CONTROLLER
    controller.stop(0.0)
    for cycle in (1.0, 1.004):
        controller.cycle(cycle, Q)
        controller.report(1e-3 * 4, Q, Q, np.zeros(6))
    if controller.receive(data, 1.004, Q):
        reference, _ = controller.references
        assert np.isnan(reference).all() or (np.abs(reference - Q) < 3.0).all()


def rsi_client(data: bytes) -> None:
    """A telegram of a controller to a client; the reply is finite and no faster than the axes may be."""
    codec = RsiCodec(SPEED, 4e-3, True, "ImFree")
    session = LinkSession[RsiReport](codec, SPEED, period=4e-3)
    session.receive(telegrams()[0].replace(b"<IPOC>8", b"<IPOC>4"), HERE, 0.0)
    found = session.receive(data, HERE, 4e-3)
    assert found is None or np.isfinite(found.position).all()
    reply = session.answer(RsiCommand(np.zeros(6), np.zeros(6)), 4e-3)
    if reply is not None:
        axes = read_sensor(reply).axes
        assert axes is not None
        assert (np.abs(axes) <= SPEED * 4e-3 + 1e-9).all()


def signals(data: bytes) -> None:
    for layout in (SignalLayout(), SignalLayout(number="text")):
        with contextlib.suppress(SignalError):
            SignalCodec(layout).decode(data)


def frame(data: bytes) -> None:
    with contextlib.suppress(PacketError):
        kind, payload = split_datagram(data)
        if kind is PacketType.DATA:
            found = decode_data(payload)
            for body in range(min(3, len(found.bodies))):
                found.pose(body)


def camera(data: bytes) -> None:
    """Bytes of a client to the camera server; it streams, so that every frame is offered too."""
    session = Session(CameraState(("tool",), 250, measuring=True), "127.0.0.1")
    session.receive(data)
    for time_us in (0, 4000):
        session.offer(time_us, lambda components: b"")


def server(data: bytes) -> None:
    """Bytes of a camera server to a client."""
    conversation, stream = Conversation("tool", StreamRequest()), PacketStream()
    with contextlib.suppress(PacketError, MocapError, ParameterError):
        for kind, payload in stream.feed(data):
            conversation.handle(kind, payload)


DECODERS: dict[str, tuple[Callable[[bytes], None], Callable[[], list[bytes]]]] = {
    "cell": (cell, commands),
    "client": (client, lambda: [report(2), report(2, position=0.001 * np.ones(6))]),
    "rsi_cell": (rsi_cell, corrections),
    "rsi_client": (rsi_client, telegrams),
    "signals": (signals, lambda: [np.arange(13.0, dtype="<f4").tobytes(), b"1.0,2.0,nan,1e400"]),
    "frame": (frame, frames),
    "camera": (camera, talk),
    "server": (server, answers),
}


def spoiled(rng: random.Random, seeds: list[bytes]) -> bytes:
    """A message with flipped bits, cut off, with bytes put in, doubled, or nothing but chance."""
    data = bytearray(rng.choice(seeds))
    for _ in range(rng.choice((1, 1, 2, 4))):
        kind, at = rng.randrange(6), rng.randrange(len(data) + 1)
        if kind <= 2 and data:
            bit = rng.randrange(8 * len(data))
            data[bit // 8] ^= 1 << bit % 8
        elif kind == 3:
            del data[at:]
        elif kind == 4:
            data[at:at] = rng.randbytes(rng.randrange(1, 9))
        elif len(data) < 10_000:
            data += data[at:]
    return bytes(data) if rng.random() > 0.02 else rng.randbytes(rng.randrange(300))


def fuzz(name: str, count: int, seed: int) -> None:
    decode, seeds = DECODERS[name][0], DECODERS[name][1]()
    rng = random.Random(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(count):
            data = spoiled(rng, seeds)
            try:
                decode(data)
            except Exception as error:
                pytest.fail(f"{name}: {type(error).__name__}: {error}: {data.hex()}")


@pytest.mark.parametrize("name", DECODERS)
def test_spoiled_messages_raise_nothing(name: str):
    fuzz(name, QUICK, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("name", DECODERS)
def test_nor_do_many_of_them(name: str):
    fuzz(name, MANY, seed=2)


@pytest.mark.parametrize("path", sorted(CORPUS.iterdir()), ids=lambda path: path.name)
@pytest.mark.real_time
def test_what_was_once_a_problem_is_none_any_more(path: Path):
    decode = DECODERS[path.name.partition("-")[0]][0]
    began = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        decode(bytes.fromhex(path.read_text()))
    assert time.process_time() - began < 20 * LONGEST  # the first one of a process builds tables


@pytest.mark.real_time
def test_a_laughing_billion_and_a_flood_of_tiny_packets_cost_no_time():
    entities = "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 10}">' for n in range(1, 10))
    xml = f'<?xml version="1.0"?><!DOCTYPE l [<!ENTITY l0 "ha">{entities}]><l><The_6D>&l9;</The_6D></l>'
    began = time.process_time()
    with pytest.raises(ParameterError, match="declarations are not read"):
        parse_bodies(xml)
    with pytest.raises(ParameterError, match="at most"):
        parse_bodies("<a>" + "<b/>" * 100_000 + "</a>")
    with pytest.raises(PacketError, match="components, at most 64"):
        decode_data(b"\0" * 12 + (2**31).to_bytes(4, "little") + b"\0" * 1000)
    assert time.process_time() - began < LONGEST


@pytest.mark.parametrize("value", [1e300, math.inf, math.nan, -1e7])
def test_a_pose_that_is_nowhere_is_refused(value: float):
    message = EgmSensor()
    message.header.seqno, message.header.mtype = 1, CORRECTION
    wire = message.planned.cartesian
    wire.pos.x, wire.pos.y, wire.pos.z = value, 0.0, 0.0
    wire.orient.u0, wire.orient.u1, wire.orient.u2, wire.orient.u3 = 1.0, 0.0, 0.0, 0.0
    controller = VirtualController(ROBOT, EgmRunConfig())
    assert not controller.receive(message.SerializeToString(), 0.0, Q)
    assert controller.undecodable == 1


def test_a_report_that_cannot_be_is_an_error_of_its_own_kind():
    with pytest.raises(EgmError):
        decode_report(b"\xff" * 50)

"""Packets: the documented bytes, column by column, and nothing that only looks like them."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform
from scipy.spatial.transform import Rotation

from systems.link.qualisys.messages import (
    Component,
    PacketError,
    PacketStream,
    PacketType,
    decode_data,
    encode_data,
    packet,
    split_datagram,
    text_of,
    text_packet,
)
from tests.systems.link.qualisys.wire import TURNED, by_hand, data_by_hand, pose

LOST = np.full((4, 4), np.nan)


def encoded(poses: list, residual: float = 0.1, kind: Component = Component.POSE_RESIDUAL) -> bytes:
    X = np.array([LOST if X is None else X.GetAsMatrix4() for X in poses]).reshape(-1, 4, 4)
    return encode_data(123_456, 42, X, np.full(len(X), 1e-3 * residual), (kind,))


def decoded(data: bytes):
    kind, payload = split_datagram(data)
    assert kind is PacketType.DATA
    return decode_data(payload)


@pytest.mark.parametrize("kind", list(Component))
def test_a_data_packet_is_what_the_documented_table_says(kind: Component):
    bodies = [TURNED, None, RigidTransform()]
    by_table = [None if body is None else (body, 0.1) for body in bodies]
    assert encoded(bodies, 0.1, kind) == data_by_hand(123_456, 42, by_table, kind)


def test_the_rotation_is_read_column_by_column_and_the_position_in_millimetres():
    frame = decoded(data_by_hand(7, 1, [(TURNED, 0.25)]))
    np.testing.assert_allclose(pose(frame), TURNED.GetAsMatrix4(), rtol=0.0, atol=1e-7)  # single precision
    assert frame.residual(0) == pytest.approx(0.25e-3)


def test_a_lost_body_is_lost_and_its_neighbours_are_not():
    frame = decoded(data_by_hand(7, 1, [(TURNED, 0.1), None, (TURNED, 0.1)]))
    assert frame.pose(1) is None
    assert frame.residual(1) == 0.0
    np.testing.assert_array_equal(pose(frame, 0), pose(frame, 2))


def test_of_two_components_the_one_with_residuals_counts_and_strangers_are_passed_over():
    stranger = struct.pack("<III", 12, 3, 0)
    both = [data_by_hand(7, 1, [(TURNED, 0.1)], kind)[24:] for kind in (5, 11)]
    frame = decoded(by_hand(3, struct.pack("<QII", 7, 1, 3) + stranger + both[0] + both[1]))
    assert frame.residual(0) == pytest.approx(1e-4)


@given(
    st.lists(st.tuples(*[st.floats(-5.0, 5.0)] * 6), max_size=6),
    st.integers(0, 2**64 - 1),
    st.integers(0, 2**32 - 1),
)
def test_poses_survive_the_wire_to_single_precision(poses: list, time_us: int, number: int):
    X = np.tile(np.eye(4), (len(poses), 1, 1))
    for matrix, given_pose in zip(X, poses, strict=True):
        matrix[:3, :3] = Rotation.from_rotvec(given_pose[:3]).as_matrix()
        matrix[:3, 3] = given_pose[3:]
    frame = decoded(encode_data(time_us, number, X, np.zeros(len(X)), (Component.POSE,)))
    assert (frame.time_us, frame.number, len(frame.bodies)) == (time_us, number, len(X))
    for place, matrix in enumerate(X):
        # Half a unit in the last place of 5 m in mm, and of one.
        np.testing.assert_allclose(pose(frame, place), matrix, rtol=0.0, atol=3e-7)


@pytest.mark.parametrize(
    ("payload", "message"),
    [
        (b"\0" * 15, "15 bytes, its header has 16"),
        (struct.pack("<QII", 1, 1, 1), "ends before all of its 1 components"),
        (struct.pack("<QII", 1, 1, 0) + b"\0", "1 bytes after the last component"),
        (struct.pack("<QII", 1, 1, 0), "no 6D component"),
        (struct.pack("<QIIII", 1, 1, 1, 7, 5), "a component of 7 bytes, 8 are left"),
        (struct.pack("<QIIII", 1, 1, 1, 9, 5), "a component of 9 bytes, 8 are left"),
        (struct.pack("<QIIII", 1, 1, 2, 8, 5) + struct.pack("<II", 8, 5), "component 5 comes twice"),
        (struct.pack("<QIIII", 1, 1, 1, 8, 5), "0 bytes, its header has 8"),
        (struct.pack("<QIIIIIhh", 1, 1, 1, 16, 5, 1, 0, 0), "1 bodies do not fit into 8 bytes"),
        (struct.pack("<QIIIIIhh", 1, 1, 1, 16, 11, 2**32 - 1, 0, 0), "bodies do not fit"),
        (struct.pack("<QII", 1, 1, 2**32 - 1), "4294967295 components, at most 64 are read"),
        (struct.pack("<QII", 1, 1, 64), "ends before all of its 64 components"),
    ],
)
def test_sizes_that_contradict_each_other_are_refused(payload: bytes, message: str):
    with pytest.raises(PacketError, match=message):
        decode_data(payload)


@pytest.mark.parametrize(
    ("datagram", "message"),
    [
        (b"", "0 bytes, a header has 8"),
        (by_hand(3)[:7], "7 bytes, a header has 8"),
        (by_hand(3) + b"\0", "states 8 bytes and has 9"),
        (by_hand(9), "type 9 is none of 0 to 8"),
    ],
)
def test_datagrams_that_are_no_packet_are_refused(datagram: bytes, message: str):
    with pytest.raises(PacketError, match=message):
        split_datagram(datagram)


def test_nine_numbers_that_are_no_rotation_are_refused():
    mirror = bytearray(data_by_hand(7, 1, [(RigidTransform(), 0.1)]))
    mirror[-8:-4] = struct.pack("<f", -1.0)  # the last entry of the matrix
    with pytest.raises(PacketError, match="no rotation"):
        decoded(bytes(mirror)).pose(0)


def mutated(rng: np.random.Generator, data: bytes) -> bytes:
    """Flipped, cut, lengthened, spliced, or nothing but noise."""
    spoiled = bytearray(data)
    way = rng.integers(6)
    if way == 0:
        return rng.bytes(int(rng.integers(0, 300)))
    if way == 1:
        del spoiled[int(rng.integers(0, len(data))) :]
    elif way == 2:
        spoiled += rng.bytes(int(rng.integers(1, 60)))
    elif way == 3:
        # A size, count or type somewhere near the truth.
        place = 4 * int(rng.integers(0, 12))
        spoiled[place : place + 4] = struct.pack("<I", int(rng.integers(0, 300)))
    elif way == 4:
        place = int(rng.integers(0, len(data)))
        spoiled[place:place] = spoiled[: int(rng.integers(0, 40))]
    else:
        for place in rng.integers(0, len(data), rng.integers(1, 6)):
            spoiled[place] = int(rng.integers(0, 256))
    return bytes(spoiled)


@pytest.mark.parametrize("count", [5000, pytest.param(300_000, marks=pytest.mark.slow)])
def test_what_is_not_a_packet_is_refused_and_what_is_accepted_says_what_it_says(count: int):
    """An accepted frame, written again from the bytes of its bodies, is the datagram that came."""
    rng = np.random.default_rng(5)
    accepted = 0
    originals = [encoded([TURNED, None, TURNED], 0.1, kind) for kind in Component]
    for _ in range(count):
        data = mutated(rng, originals[rng.integers(2)])
        try:
            kind, payload = split_datagram(data)
            frame = decode_data(payload) if kind is PacketType.DATA else None
        except PacketError:
            continue
        if frame is None:
            continue
        width, rates = frame.bodies.shape[1], data[36:40]
        content = struct.pack("<I", len(frame.bodies)) + rates + frame.bodies.tobytes()
        component = struct.pack("<II", 8 + len(content), {12: 5, 13: 11}[width]) + content
        again = by_hand(3, struct.pack("<QII", frame.time_us, frame.number, 1) + component)
        assert again == data
        accepted += 1
    assert 0 < accepted < count / 2  # flipped bits in a position cannot be told


@given(st.lists(st.binary(max_size=40), max_size=5), st.lists(st.integers(1, 30), min_size=1, max_size=10))
def test_packets_are_found_in_a_stream_cut_anywhere(payloads: list[bytes], cuts: list[int]):
    whole = b"".join(packet(PacketType.XML, payload) for payload in payloads)
    stream, found, start = PacketStream(), [], 0
    while start < len(whole):
        cut = cuts[start % len(cuts)]
        found += stream.feed(whole[start : start + cut])
        start += cut
    assert found == [(PacketType.XML, payload) for payload in payloads]


@pytest.mark.parametrize("size", [0, 7, 2**20 + 1, 2**32 - 1])
def test_a_stream_with_an_impossible_size_is_refused(size: int):
    with pytest.raises(PacketError, match=f"states {size} bytes"):
        list(PacketStream().feed(struct.pack("<II", size, 1)))


@given(st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"])))
def test_text_survives_the_wire(text: str):
    kind, payload = split_datagram(text_packet(PacketType.COMMAND, text))
    assert (kind, text_of(payload)) == (PacketType.COMMAND, text)


def test_text_of_old_servers_is_read_as_latin_1():
    assert text_of("Fräser".encode("latin-1")) == "Fräser"

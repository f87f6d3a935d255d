"""Packets of the Qualisys real-time protocol, little-endian, as it is since version 1.8.

A packet is its size and type (4 bytes each, the size counts them too) and a payload. Commands, answers and
errors are text that ends in a zero byte. A data packet holds one exposure: its stamp, its number and
components; read here are the two that carry the poses of bodies as rotation matrices. On the wire a position
is in mm and a rotation matrix is written column by column; a body that the cameras have lost is NaN.

Numbers from "QTM RT Server Protocol Documentation", Qualisys AB, sections Packet, Data packet and
6DOF component; versions before 1.8 sent the rotation as doubles and are not spoken.
"""

import math
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

PORT = 22223  # where a server speaks little-endian
LARGEST_PACKET = 1 << 20  # bytes; the parameters of a hundred bodies need 100 kB

_HEADER = struct.Struct("<II")  # size and type, of a packet and of a component alike
_DATA_HEADER = struct.Struct("<QII")  # stamp in us, frame number, number of components
_BODIES_HEADER = struct.Struct("<IHH")  # number of bodies, drop rate, out-of-sync rate
_MOST_COMPONENTS = 64  # of a data packet; the protocol knows about twenty
_LOST_BITS = 0xFFFFFFFF  # the NaN that the protocol writes
_ORTHONORMAL_WITHIN = 1e-4  # a rotation in single precision is exact to about 2e-7


class PacketError(ValueError):
    """Bytes that are not a packet of the protocol; the message says why."""


class PacketType(IntEnum):
    """Type of a packet."""

    ERROR = 0
    COMMAND = 1
    XML = 2
    DATA = 3
    NO_MORE_DATA = 4
    C3D_FILE = 5
    EVENT = 6
    DISCOVER = 7
    QTM_FILE = 8


class Event(IntEnum):
    """State that a server announces, unasked or in reply to GetState."""

    CONNECTED = 1
    CONNECTION_CLOSED = 2
    CAPTURE_STARTED = 3
    CAPTURE_STOPPED = 4
    RT_FROM_FILE_STARTED = 8
    RT_FROM_FILE_STOPPED = 9
    WAITING_FOR_TRIGGER = 10
    CAMERA_SETTINGS_CHANGED = 11
    SHUTTING_DOWN = 12


class Component(IntEnum):
    """The components that are read; the names on the wire are those of `COMPONENT_NAMES`."""

    POSE = 5
    POSE_RESIDUAL = 11


COMPONENT_NAMES = {"6D": Component.POSE, "6DRes": Component.POSE_RESIDUAL}
_WIDTH = {Component.POSE: 12, Component.POSE_RESIDUAL: 13}  # floats of a body


@dataclass(frozen=True, slots=True)
class Frame:
    """One exposure on the wire: time stamp and bodies in the order of the server's parameters."""

    time_us: int  # since the server's measurement began
    number: int  # always 1 in the live mode of some servers: the stamp tells frames apart, not this
    bodies: np.ndarray  # (n, 12) or (n, 13) float32: position in mm, rotation by columns, residual in mm

    def pose(self, body: int) -> np.ndarray | None:
        """The pose of a body as a (4, 4) matrix, translation in m; None if the body is lost.

        Raises:
            IndexError: if there is no such body.
            PacketError: if the nine numbers are no rotation.
        """
        row = self.bodies[body].tolist()
        x, y, z, xx, xy, xz, yx, yy, yz, zx, zy, zz = row[:12]
        if not math.isfinite(sum(row[:12])):
            return None
        _refuse_no_rotation((xx, xy, xz), (yx, yy, yz), (zx, zy, zz))
        return np.array(
            [
                [xx, yx, zx, 1e-3 * x],
                [xy, yy, zy, 1e-3 * y],
                [xz, yz, zz, 1e-3 * z],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )

    def residual(self, body: int) -> float:
        """The server's own estimate of a body's error in m; zero where it sends none."""
        residual = float(self.bodies[body, 12]) if self.bodies.shape[1] > 12 else 0.0
        return 1e-3 * residual if math.isfinite(residual) else 0.0


def _refuse_no_rotation(x: Sequence[float], y: Sequence[float], z: Sequence[float]) -> None:
    """Columns of a rotation have length one, and the third is the product of the others."""
    product = (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
    differences = [abs(p - q) for p, q in zip(product, z, strict=True)]
    error = max(abs(math.hypot(*x) - 1.0), abs(math.hypot(*y) - 1.0), *differences)
    if not error < _ORTHONORMAL_WITHIN:
        raise PacketError(f"data packet: nine numbers that are no rotation (off by {error:.2g})")


def packet(kind: PacketType, payload: bytes = b"") -> bytes:
    """A packet of the given type."""
    return _HEADER.pack(_HEADER.size + len(payload), kind) + payload


def text_packet(kind: PacketType, text: str) -> bytes:
    """A command, an answer, an error or XML."""
    return packet(kind, text.encode() + b"\0")


def text_of(payload: bytes) -> str:
    """The text of a payload, without its zero byte; what is not UTF-8 is read as Latin-1."""
    raw = payload.split(b"\0", 1)[0]
    try:
        return raw.decode()
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def split_datagram(datagram: bytes) -> tuple[PacketType, bytes]:
    """Type and payload of a datagram, which holds exactly one packet.

    Raises:
        PacketError: if it is too short, its size is not the one that it states, or its type is unknown.
    """
    if len(datagram) < _HEADER.size:
        raise PacketError(f"packet: {len(datagram)} bytes, a header has {_HEADER.size}")
    size, kind = _HEADER.unpack_from(datagram)
    if size != len(datagram):
        raise PacketError(f"packet: states {size} bytes and has {len(datagram)}")
    return _packet_type(kind), datagram[_HEADER.size :]


def _packet_type(kind: int) -> PacketType:
    try:
        return PacketType(kind)
    except ValueError:
        raise PacketError(f"packet: type {kind} is none of 0 to {max(PacketType)}") from None


class PacketStream:
    """Splits a TCP byte stream into packets."""

    def __init__(self) -> None:
        self._pending = bytearray()

    def feed(self, data: bytes) -> Iterator[tuple[PacketType, bytes]]:
        """Adds received bytes; type and payload of each packet that is complete now.

        Raises:
            PacketError: if the bytes cannot be a packet. The place of the next one is then unknown, so the
                connection is of no more use.
        """
        self.put(data)
        yield from self.complete()

    def put(self, data: bytes) -> None:
        """Adds received bytes, for `complete`."""
        self._pending += data

    def complete(self) -> Iterator[tuple[PacketType, bytes]]:
        """The packets that are complete and have not been taken yet; as `feed`."""
        while len(self._pending) >= _HEADER.size:
            size, kind = _HEADER.unpack_from(self._pending)
            if not _HEADER.size <= size <= LARGEST_PACKET:
                raise PacketError(f"packet: states {size} bytes, {_HEADER.size} to {LARGEST_PACKET} allowed")
            kind = _packet_type(kind)
            if len(self._pending) < size:
                return
            payload = bytes(self._pending[_HEADER.size : size])
            del self._pending[:size]
            yield kind, payload


def decode_data(payload: bytes) -> Frame:
    """Reads a data packet. Of several components with bodies the one with residuals counts.

    Raises:
        PacketError: if the sizes contradict each other, a component comes twice, or no bodies are in it.
    """
    if len(payload) < _DATA_HEADER.size:
        raise PacketError(f"data packet: {len(payload)} bytes, its header has {_DATA_HEADER.size}")
    time_us, number, count = _DATA_HEADER.unpack_from(payload)
    if count > _MOST_COMPONENTS:
        raise PacketError(f"data packet: {count} components, at most {_MOST_COMPONENTS} are read")
    offset, found = _DATA_HEADER.size, {}
    for _ in range(count):
        if len(payload) < offset + _HEADER.size:
            raise PacketError(f"data packet: ends before all of its {count} components")
        size, kind = _HEADER.unpack_from(payload, offset)
        if not _HEADER.size <= size <= len(payload) - offset:
            raise PacketError(f"data packet: a component of {size} bytes, {len(payload) - offset} are left")
        if kind in found:
            raise PacketError(f"data packet: component {kind} comes twice")
        found[kind] = (offset + _HEADER.size, size - _HEADER.size)
        offset += size
    if offset != len(payload):
        raise PacketError(f"data packet: {len(payload) - offset} bytes after the last component")
    for kind in (Component.POSE_RESIDUAL, Component.POSE):
        if kind in found:
            return Frame(time_us, number, _decode_bodies(payload, kind, *found[kind]))
    raise PacketError(f"data packet: no 6D component, only {sorted(found)}")


def _decode_bodies(payload: bytes, kind: Component, offset: int, size: int) -> np.ndarray:
    if size < _BODIES_HEADER.size:
        raise PacketError(f"6D component: {size} bytes, its header has {_BODIES_HEADER.size}")
    count, _, _ = _BODIES_HEADER.unpack_from(payload, offset)
    width = _WIDTH[kind]
    if size != _BODIES_HEADER.size + 4 * width * count:
        raise PacketError(f"6D component: {count} bodies do not fit into {size} bytes")
    values = np.frombuffer(payload, "<f4", count * width, offset + _BODIES_HEADER.size)
    return values.reshape(count, width)


def encode_data(
    time_us: int, number: int, X_WB: np.ndarray, residual: np.ndarray, components: Sequence[Component]
) -> bytes:
    """A whole data packet.

    Args:
        time_us: stamp of the exposure.
        number: of the frame, counted modulo 2^32.
        X_WB: shape (n, 4, 4), translation in m; NaN anywhere in a pose: that body is lost.
        residual: shape (n,), m.
        components: which components to write, in this order.
    """
    values = np.empty((len(X_WB), 13), "<f4")
    values[:, :3] = 1e3 * X_WB[:, :3, 3]
    values[:, 3:12] = X_WB[:, :3, :3].transpose(0, 2, 1).reshape(-1, 9)
    values[:, 12] = 1e3 * residual
    lost = ~np.isfinite(values[:, :12]).all(axis=1)
    values.view("<u4")[lost] = _LOST_BITS
    parts = [_DATA_HEADER.pack(time_us, number & 0xFFFFFFFF, len(components))]
    for component in components:
        content = values[:, : _WIDTH[component]].tobytes()
        size = _HEADER.size + _BODIES_HEADER.size + len(content)
        parts += [_HEADER.pack(size, component), _BODIES_HEADER.pack(len(values), 0, 0), content]
    return packet(PacketType.DATA, b"".join(parts))

"""The format written down a second time, and what the tests of the wire share."""

import socket
import struct
import threading
import time
from collections.abc import Callable
from contextlib import contextmanager

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from robots.pose import rotation_from_zyx
from systems.link.qualisys.messages import Frame

# Not symmetric, and no two of its entries alike: a transposed reading cannot pass.
TURNED = RigidTransform(RotationMatrix(rotation_from_zyx(np.array([0.4, -0.7, 1.1]))), [0.3, -0.4, 0.5])
XML = "<QTM_Parameters_Ver_1.25><The_6D><Body><Name>tool</Name></Body></The_6D></QTM_Parameters_Ver_1.25>"

COMMAND, XML_PACKET, DATA, NO_MORE_DATA, EVENT, ERROR = 1, 2, 3, 4, 6, 0


def by_hand(kind: int, payload: bytes = b"") -> bytes:
    """A packet, put together from the documented table."""
    return struct.pack("<II", 8 + len(payload), kind) + payload


def say(kind: int, text: str) -> bytes:
    return by_hand(kind, text.encode() + b"\0")


def data_by_hand(time_us: int, number: int, bodies: list, kind: int = 11) -> bytes:
    """A data packet with one 6D component; a body is (RigidTransform, residual in mm), or None: lost."""
    rows = b""
    for body in bodies:
        if body is None:
            rows += b"\xff" * (52 if kind == 11 else 48)
            continue
        X, residual = body
        rows += struct.pack("<3f", *(1000.0 * X.translation()))
        for column in range(3):
            for row in range(3):
                rows += struct.pack("<f", X.rotation().matrix()[row, column])
        rows += struct.pack("<f", residual) if kind == 11 else b""
    component = struct.pack("<IIIhh", 16 + len(rows), kind, len(bodies), 0, 0) + rows
    return by_hand(DATA, struct.pack("<QII", time_us, number, 1) + component)


def pose(frame: Frame, place: int | None = 0) -> np.ndarray:
    """The pose of a body that is there and not lost."""
    assert place is not None
    X = frame.pose(place)
    assert X is not None
    return X


def until(condition: Callable[[], object], timeout: float = 5.0) -> None:
    """Waits for something that another thread or the network does."""
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(1e-3)


class ScriptedServer:
    """Accepts one client at a time and writes prepared bytes, one piece for each command that it reads."""

    def __init__(self, pieces: list[bytes], port: int = 0) -> None:
        self._listener = socket.create_server(("127.0.0.1", port))
        self.port = self._listener.getsockname()[1]
        self.commands: list[str] = []
        self._pieces = pieces
        self.connection: socket.socket | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self.connection, _ = self._listener.accept()
            for piece in self._pieces:
                for byte in range(0, len(piece), 7):  # in pieces that fit no packet
                    self.connection.sendall(piece[byte : byte + 7])
                size = struct.unpack("<I", self.connection.recv(4, socket.MSG_WAITALL))[0]
                rest = self.connection.recv(size - 4, socket.MSG_WAITALL)
                self.commands.append(rest[4:].rstrip(b"\0").decode())
        except (OSError, struct.error):
            pass  # the test has ended

    def close(self) -> None:
        self._listener.close()
        if self.connection is not None:
            self.connection.close()
        self._thread.join(5.0)


@contextmanager
def scripted(pieces: list[bytes]):
    server = ScriptedServer(pieces)
    try:
        yield server
    finally:
        server.close()

"""Frames over UDP, accepted from the server's address only, each with its age."""

import socket
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass

from systems.link.qualisys.messages import Frame, PacketError, PacketType, decode_data, split_datagram

_LARGEST = 65535  # bytes of a datagram
_MOST = 1024  # datagrams read in one go, lest a flood holds the loop
_BUFFER = 1 << 20  # bytes the kernel keeps: seconds of frames, should the reader stall

# Linux stamps datagrams as they come in; Python knows neither the option nor the message by name.
_STAMPS = 35 if sys.platform == "linux" else None
_TIMESPEC = struct.Struct("@ll")
_ANCILLARY = socket.CMSG_SPACE(_TIMESPEC.size) if _STAMPS else 0
_OLDEST = 10.0  # s; a larger age is a wall clock that was set in between


@dataclass
class Counters:
    """Counts since the client was created."""

    frames: int = 0  # that could be read
    wrong_sender: int = 0  # datagrams from elsewhere, ignored
    garbage: int = 0  # datagrams and data packets that could not be read
    no_more_data: int = 0  # packets that say: nothing is measured at the time
    connections: int = 0  # that came as far as streaming
    disconnections: int = 0  # of those


@dataclass(frozen=True, slots=True)
class Arrival:
    """A frame, and how long before the poll it came, as far as the operating system can tell."""

    frame: Frame
    age: float = 0.0  # s, negative if it came while the poll was at work; zero where it is not known


class DatagramReceiver:
    """A socket for the frames of one server.

    Datagrams of other machines are ignored; so are, from the first frame on, those of other ports of the
    same machine.
    """

    def __init__(self, address: str, port: int, sender: str, counters: Counters) -> None:
        """Binds the socket.

        Args:
            address: own address; loopback for a server on this machine.
            port: own port, 0 for any free one.
            sender: address of the server.
            counters: counted in here.

        Raises:
            OSError: if the address or port cannot be had.
        """
        self._sender, self._sender_port = sender, None
        self._counters = counters
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((address, port))
        except OSError as error:
            self._socket.close()
            raise OSError(error.errno, f"UDP {address}:{port}: {error.strerror}") from error
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        if _STAMPS:
            self._socket.setsockopt(socket.SOL_SOCKET, _STAMPS, 1)

    @property
    def port(self) -> int:
        """Own port."""
        return self._socket.getsockname()[1]

    def receive(self, polled_ns: int) -> Iterator[Arrival]:
        """Every frame that waits, oldest first.

        Args:
            polled_ns: when the poll began, by `time.time_ns`; ages count from there.
        """
        for _ in range(_MOST):
            try:
                datagram, ancillary, _, source = self._socket.recvmsg(_LARGEST, _ANCILLARY)
            except BlockingIOError:
                return
            if source[0] != self._sender or self._sender_port not in (None, source[1]):
                self._counters.wrong_sender += 1
                continue
            frame = read_frame(datagram, self._counters)
            if frame is not None:
                self._sender_port = source[1]
                yield Arrival(frame, _age(ancillary, polled_ns))

    def close(self) -> None:
        """Gives the port back."""
        self._socket.close()


def read_frame(datagram: bytes, counters: Counters) -> Frame | None:
    """The frame in a datagram; None, and counted, if there is none in it."""
    try:
        kind, payload = split_datagram(datagram)
        if kind is PacketType.DATA:
            return decode_data(payload)
    except PacketError:
        counters.garbage += 1
        return None
    if kind is PacketType.NO_MORE_DATA:
        counters.no_more_data += 1
    else:
        counters.garbage += 1  # nothing else comes over UDP
    return None


def _age(ancillary: list[tuple[int, int, bytes]], polled_ns: int) -> float:
    """From the arrival in the kernel until the poll; the wall clock is asked for this short time only."""
    for level, kind, data in ancillary:
        if level == socket.SOL_SOCKET and kind == _STAMPS:
            seconds, nanoseconds = _TIMESPEC.unpack(data)
            age = 1e-9 * (polled_ns - (1_000_000_000 * seconds + nanoseconds))
            return age if abs(age) <= _OLDEST else 0.0
    return 0.0

"""UDP sockets: bound to one address, never blocking, read to the end."""

import ipaddress
import select
import socket
from enum import Enum

Address = tuple[str, int]

_LARGEST_DATAGRAM = 65536
_LARGEST_BATCH = 5000  # datagrams at once: whoever floods the port does not stop the loop
_BUFFER = 1 << 20  # bytes; the kernel keeps the oldest datagrams when it is full


def is_loopback(address: str) -> bool:
    """Whether an address reaches this machine alone."""
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return address == "localhost"


def ipv4_address(whose: str, address: str) -> str:
    """The address of a machine by its name or address, as datagrams from it have it.

    Args:
        whose: for the message.
        address: a name or an address.

    Raises:
        ChannelError: if it has none of IPv4, the one that controllers speak.
    """
    try:
        return socket.gethostbyname(address)
    except (OSError, UnicodeError) as error:
        raise ChannelError(f"{whose}: no IPv4 address is known for '{address}'") from error


class Buffering(Enum):
    """Which of several queued datagrams are used, Probst (2024), table A.5."""

    NEXT = "next"  # one after the other
    NEWEST = "newest"  # all are read, the newest counts
    CLEAR_ONCE = "clear_once"  # what waits at the beginning is thrown away, then one after the other


class ChannelError(ValueError):
    """An address or port that cannot be used."""


class UdpChannel:
    """A UDP socket; on this machine alone, unless another address is given."""

    def __init__(
        self, port: int = 0, address: str = "127.0.0.1", buffering: Buffering = Buffering.NEWEST
    ) -> None:
        """Binds the socket.

        Args:
            port: where to listen, 0 for any free one.
            address: of the interface to listen on.
            buffering: what to do with datagrams that wait.

        Raises:
            ChannelError: if the address is not one of this machine or the port is taken.
        """
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
            self._socket.bind((address, port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            why = getattr(error, "strerror", None) or str(error)
            raise ChannelError(f"cannot listen on UDP {address}:{port}: {why.lower()}") from error
        self._socket.setblocking(False)
        self._buffering, self._is_cleared = buffering, False

    @property
    def address(self) -> Address:
        """Where the socket listens."""
        return self._socket.getsockname()

    def fileno(self) -> int:
        """For `select`."""
        return self._socket.fileno()

    def wait(self, timeout: float) -> bool:
        """Waits until something can be read, for at most ``timeout`` in s."""
        try:
            return bool(select.select([self._socket], [], [], max(0.0, timeout))[0])
        except InterruptedError:
            return False

    def receive(self) -> list[tuple[bytes, Address]]:
        """What is there, oldest first: everything, or one datagram if one is to follow the other."""
        if self._buffering is Buffering.CLEAR_ONCE and not self._is_cleared:
            self._is_cleared = True
            while self._read(_LARGEST_BATCH):
                pass
        return self._read(_LARGEST_BATCH if self._buffering is Buffering.NEWEST else 1)

    def _read(self, count: int) -> list[tuple[bytes, Address]]:
        datagrams = []
        while len(datagrams) < count:
            try:
                datagrams.append(self._socket.recvfrom(_LARGEST_DATAGRAM))
            except (BlockingIOError, InterruptedError):
                break
            except ConnectionError:
                # A reply to a program that has gone is reported here; it says nothing of what follows.
                continue
        return datagrams

    def send(self, data: bytes, to: Address) -> bool:
        """Sends a datagram; False if the system does not take it."""
        try:
            self._socket.sendto(data, to)
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Frees the port."""
        self._socket.close()

    def __enter__(self) -> "UdpChannel":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

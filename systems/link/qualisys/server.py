"""A virtual camera server with the Qualisys protocol, so that any client can measure a simulated robot.

It listens in a thread of its own. The simulation pushes poses in by `VirtualCameraServer.publish`, which
sends them at once, from the thread of the simulation: a frame is on the wire before the call returns.
"""

import contextlib
import ipaddress
import selectors
import socket
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from pydrake.math import RigidTransform

from systems.link.qualisys.messages import PORT, Component, PacketType, encode_data, text_packet
from systems.link.qualisys.session import CameraState, Session

_MOST_CLIENTS = 10
_CHUNK = 1 << 12  # bytes read at once: frames wait while they are answered, and commands are short

Address = tuple[str, int]
Send = Callable[[bytes, Address], None]


@dataclass
class CameraServerConfig:
    """Where the virtual camera listens and what it tracks; read from a scenario file."""

    bodies: list[str] = field(default_factory=lambda: ["tool"])
    address: str = "127.0.0.1"  # another address than loopback makes the camera visible to others
    port: int = PORT  # 0: any free one
    frequency: int = 250  # Hz, as told to clients; the frames come when they are published


@dataclass
class _Client:
    socket: socket.socket
    session: Session


class VirtualCameraServer:
    """Serves the poses of rigid bodies to several clients at once.

    Use it as a context manager: it listens from ``with`` on, and closes all connections at the end.
    """

    def __init__(self, config: CameraServerConfig, disturb: Callable[[Send], Send] | None = None) -> None:
        """Binds the port, so that a client may try to connect from now on.

        Args:
            config: address, port and bodies.
            disturb: gets the function that sends a datagram and returns the one to use instead, which may
                lose, repeat, delay or spoil it.

        Raises:
            ValueError: if the bodies are no distinct names, or the address is no address of one interface.
            OSError: if the port cannot be had.
        """
        _check(config)
        self._camera = CameraState(tuple(config.bodies), config.frequency)
        self._clients: list[_Client] = []
        self._lock = threading.RLock()
        try:
            self._listener = socket.create_server((config.address, config.port))
        except OSError as error:
            place, why = f"TCP {config.address}:{config.port}", (error.strerror or str(error)).lower()
            raise OSError(f"virtual camera: cannot listen on {place}: {why.partition(' (')[0]}") from error
        self._listener.setblocking(False)
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._udp.bind((config.address, 0))
        self._udp.setblocking(False)
        self._send_datagram = disturb(self._send_plain) if disturb else self._send_plain
        self._wake, self._woken = socket.socketpair()
        self._wake.setblocking(False)
        self._selector = selectors.DefaultSelector()
        self._thread = threading.Thread(target=self._run, name="virtual camera server", daemon=True)
        self._closing = False

    @property
    def address(self) -> Address:
        """Address and TCP port that clients connect to."""
        return self._listener.getsockname()

    @property
    def port(self) -> int:
        """The TCP port that clients connect to."""
        return self.address[1]

    @property
    def clients(self) -> int:
        """How many are connected."""
        return len(self._clients)

    @property
    def streams(self) -> int:
        """How many clients have asked for a stream."""
        with self._lock:
            return sum(client.session.stream is not None for client in self._clients)

    @property
    def left_out(self) -> int:
        """Frames that were not sent because a client over TCP did not read."""
        with self._lock:
            return sum(client.session.left_out for client in self._clients)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends all connections and gives the ports back."""
        if self._closing:
            return
        self._closing = True
        if self._thread.is_alive():
            self._wake.send(b"\0")
            self._thread.join()
        with self._lock:
            for client in self._clients:
                client.socket.close()
            self._clients.clear()
        for end in (self._listener, self._udp, self._wake, self._woken, self._selector):
            end.close()

    def publish(
        self,
        time_us: int,
        frame: int,
        bodies: Mapping[str, RigidTransform | None],
        residuals: Mapping[str, float] | None = None,
    ) -> None:
        """Sends an exposure to all clients that want it. The first one begins a measurement.

        Args:
            time_us: stamp of the exposure on the camera's clock, since its measurement began.
            frame: its number.
            bodies: pose of each body in the frame of the camera system; one that is None or missing is lost.
            residuals: m, the camera's own estimate of the error of each body; zero where it is missing.

        Raises:
            ValueError: if a body is not one of those that the server tracks, or the stamp is negative.
        """
        if time_us < 0:
            raise ValueError(f"virtual camera: a stamp must not be negative, got {time_us} us")
        poses, errors = self._arrays(bodies, residuals or {})
        cache: dict[tuple[Component, ...], bytes] = {}

        def encoded(components: tuple[Component, ...]) -> bytes:
            if components not in cache:
                cache[components] = encode_data(time_us, frame, poses, errors, components)
            return cache[components]

        with self._lock:
            if not self._camera.measuring:
                self._change_state(measuring=True)
            for client in self._clients:
                client.session.offer(time_us, encoded)
                self._flush(client)

    def finish(self) -> None:
        """Ends the measurement: clients are told that there is no more data, until the next `publish`."""
        with self._lock:
            if self._camera.measuring:
                self._change_state(measuring=False)

    def _arrays(
        self, bodies: Mapping[str, RigidTransform | None], residuals: Mapping[str, float]
    ) -> tuple[np.ndarray, np.ndarray]:
        names = self._camera.names
        unknown = sorted({*bodies, *residuals} - set(names))
        if unknown:
            raise ValueError(f"virtual camera: no such body: {', '.join(unknown)}; it has {', '.join(names)}")
        poses = np.full((len(names), 4, 4), np.nan)
        for row, name in zip(poses, names, strict=True):
            X_WB = bodies.get(name)
            if X_WB is not None:
                row[:3] = X_WB.GetAsMatrix34()
        return poses, np.array([residuals.get(name, 0.0) for name in names])

    def _change_state(self, measuring: bool) -> None:
        self._camera.measuring = measuring
        for client in self._clients:
            client.session.announce(self._camera.event)
            self._flush(client)

    def _flush(self, client: _Client) -> None:
        """Sends what a session has to send; what the connection does not take yet stays for the thread."""
        session = client.session
        for data, address in session.datagrams:
            self._send_datagram(data, address)
        session.datagrams.clear()
        if not session.outbox:
            return
        # A broken connection shows when the thread reads from it.
        with contextlib.suppress(OSError):
            del session.outbox[: client.socket.send(session.outbox)]
        if session.outbox:
            with contextlib.suppress(OSError):  # full: the thread is being woken already
                self._wake.send(b"\0")

    def _send_plain(self, data: bytes, address: Address) -> None:
        with contextlib.suppress(OSError):  # a full buffer or a closed port is a lost datagram
            self._udp.sendto(data, address)

    def _run(self) -> None:
        self._selector.register(self._listener, selectors.EVENT_READ, self._accept)
        self._selector.register(self._woken, selectors.EVENT_READ, lambda: self._woken.recv(_CHUNK))
        while not self._closing:
            for key, events in self._selector.select():
                with self._lock:
                    if isinstance(key.data, _Client):
                        self._serve(key.data, events)
                    else:
                        key.data()
            with self._lock:
                for client in self._clients:
                    waits = selectors.EVENT_WRITE if client.session.outbox else 0
                    self._selector.modify(client.socket, selectors.EVENT_READ | waits, client)

    def _accept(self) -> None:
        try:
            connection, (host, _) = self._listener.accept()
        except OSError:
            return  # gone before it was served
        connection.setblocking(False)
        if len(self._clients) >= _MOST_CLIENTS:
            refusal = "Connection refused. Max number of clients reached."
            with contextlib.suppress(OSError):
                connection.send(text_packet(PacketType.ERROR, refusal))
            connection.close()
            return
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client = _Client(connection, Session(self._camera, host))
        self._clients.append(client)
        self._selector.register(connection, selectors.EVENT_READ, client)
        self._flush(client)

    def _serve(self, client: _Client, events: int) -> None:
        if events & selectors.EVENT_READ:
            try:
                data = client.socket.recv(_CHUNK)
            except BlockingIOError:
                data = None
            except OSError:
                data = b""
            if data == b"" or (data and not client.session.receive(data)):
                self._drop(client)
                return
        self._flush(client)

    def _drop(self, client: _Client) -> None:
        self._clients.remove(client)
        self._selector.unregister(client.socket)
        client.socket.close()


def _check(config: CameraServerConfig) -> None:
    if not config.bodies or len(set(config.bodies)) < len(config.bodies) or "" in config.bodies:
        raise ValueError(f"virtual camera: bodies must be distinct names, got {config.bodies}")
    if not 0 <= config.port < 65536:
        raise ValueError(f"virtual camera: port must be 0 to 65535, got {config.port}")
    if config.frequency < 1:
        raise ValueError(f"virtual camera: frequency must be 1 Hz or more, got {config.frequency}")
    try:
        address = ipaddress.IPv4Address("127.0.0.1" if config.address == "localhost" else config.address)
    except ValueError as error:
        raise ValueError(f"virtual camera: '{config.address}' is no IPv4 address of an interface") from error
    if address.is_unspecified:
        raise ValueError(
            f"virtual camera: {address} would listen to every network; give the address of one interface"
        )

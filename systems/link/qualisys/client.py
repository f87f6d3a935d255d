"""A non-blocking client of a Qualisys server that streams the poses of one body.

`MocapClient.poll` belongs into a loop. It takes whatever has arrived, moves the conversation on by one answer
and returns at once, connected or not; a server that goes away is noticed, reported and asked again. The
conversation runs over TCP; frames come over UDP, where a lost one delays no other, or over the same TCP.
"""

import contextlib
import errno
import os
import select
import socket
import time
from dataclasses import dataclass

from robots.configuration.quantity import choice, positive, quantity
from systems.link.qualisys.conversation import Conversation, MocapError, State
from systems.link.qualisys.datagrams import Arrival, Counters, DatagramReceiver
from systems.link.qualisys.messages import (
    COMPONENT_NAMES,
    PORT,
    Event,
    Frame,
    PacketError,
    PacketStream,
    PacketType,
    decode_data,
    text_packet,
)
from systems.link.qualisys.parameters import ParameterError
from systems.link.qualisys.stream_request import StreamRequest
from systems.link.udp_channel import ChannelError, ipv4_address

_CHUNK = 1 << 16  # bytes read at once
_MOST_PACKETS = 200  # taken in one poll, lest a flood of tiny ones holds the loop
_MOST_TEXT = 200  # characters of what a server says, for messages
_MOST_CHUNKS = 64  # read in one poll, lest a flood holds the loop


@dataclass
class MocapConfig:
    """Where the camera server is and what to ask for; read from a scenario file."""

    body: str = "tool"  # name of the rigid body, as the server knows it
    address: str = "127.0.0.1"  # of the server
    # Of the server; 22223 is the one on which it speaks little-endian. 0: any free one, of a virtual server
    port: int = quantity(PORT, 0, 65535)
    transport: str = choice("udp", ("udp", "tcp"))
    # Own port for the frames, for a firewall that wants a certain one; 0: any free one
    udp_port: int = quantity(0, 0, 65535)
    component: str = choice("6DRes", COMPONENT_NAMES)  # 6D is without the residual
    frequency: int | None = quantity(None, 1, unit="Hz")  # None: every frame
    # For an answer, and of silence before the server is asked whether it lives
    timeout: float = positive(2.0, "s")
    retry: float = positive(1.0, "s")  # between attempts to connect


class MocapClient:
    """A connection to a server for one body; it reconnects when it breaks."""

    def __init__(self, config: MocapConfig) -> None:
        """Checks the configuration; the first `poll` connects.

        Raises:
            ValueError: if an entry is not one of those allowed.
            ChannelError: if the address is not known, or there is no port.
        """
        _check(config)
        self._config = config
        self._host = ipv4_address("camera server", config.address)
        self.counters = Counters()
        self.last_error = ""
        self._tcp: socket.socket | None = None
        self._udp: DatagramReceiver | None = None
        self._stream = PacketStream()
        self._talk: Conversation | None = None
        self._heard = 0.0  # s, when something came last
        self._probed: float | None = None  # s, when the silent server was asked whether it lives
        self._not_before = 0.0  # s, of the next attempt

    @property
    def state(self) -> State:
        """How far the connection has come."""
        if self._talk is not None:
            return self._talk.state
        return State.DISCONNECTED if self._tcp is None else State.CONNECTING

    @property
    def version(self) -> str:
        """The version of the protocol that is spoken; empty before it is agreed on."""
        return self._talk.version if self._talk is not None else ""

    @property
    def udp_port(self) -> int | None:
        """The own port to which frames are to come, while there is one."""
        return self._udp.port if self._udp is not None else None

    @property
    def event(self) -> Event | None:
        """What the server said of itself last in this connection."""
        return self._talk.event if self._talk is not None else None

    def place(self, frame: Frame) -> int | None:
        """Where the body stands in a frame; None if frame and parameters do not fit together."""
        return self._talk.place(frame) if self._talk is not None else None

    def wait(self, timeout: float) -> None:
        """Polls until frames are asked for. For the start of a program, not for a loop.

        Raises:
            MocapError: if the server is not there in time, or does not know the body.
        """
        deadline = time.monotonic() + timeout
        self.poll()
        while self.state is not State.STREAMING:
            if time.monotonic() > deadline:
                reason = self.last_error or f"no answer ({self.state.value})"
                raise MocapError(f"camera server {self._config.address}:{self._config.port}: {reason}")
            time.sleep(1e-3)
            self.poll()

    def poll(self) -> list[Arrival]:
        """Takes what has arrived; never waits, and never raises for what a server does.

        Returns:
            The frames since the last call, oldest first. What cannot be read is counted.
        """
        polled_ns, now = time.time_ns(), time.monotonic()
        arrivals: list[Arrival] = []
        try:
            if self._tcp is None:
                if now >= self._not_before:
                    self._connect(now)
            elif self._talk is None:
                self._finish_connecting()
            else:
                self._read_tcp(arrivals)
                if self._udp is not None:
                    arrivals += self._udp.receive(polled_ns)
                if arrivals:
                    self._heard, self._probed = now, None
            if self._tcp is not None:
                self._check_silence(now)
        except (OSError, PacketError, ParameterError, MocapError) as error:
            self._disconnect(now, getattr(error, "strerror", None) or str(error))
        self.counters.frames += len(arrivals)
        return arrivals

    def close(self) -> None:
        """Ends the connection; `poll` would begin a new one."""
        if self.state is State.STREAMING:
            with contextlib.suppress(OSError, MocapError):  # it may be gone already
                self._send("StreamFrames Stop")
        self._drop()

    def __enter__(self) -> "MocapClient":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _connect(self, now: float) -> None:
        self._heard, self._probed = now, None
        self._stream = PacketStream()
        self._tcp = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._tcp.setblocking(False)
        self._tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        _refuse_error(self._tcp.connect_ex((self._host, self._config.port)))

    def _finish_connecting(self) -> None:
        assert self._tcp is not None
        if not select.select([], [self._tcp], [], 0.0)[1]:
            return
        _refuse_error(self._tcp.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR))
        port = None
        if self._config.transport == "udp":
            # The own address on the way to the server: loopback for a server on this machine.
            own = self._tcp.getsockname()[0]
            self._udp = DatagramReceiver(own, self._config.udp_port, self._host, self.counters)
            port = self._udp.port
        component = COMPONENT_NAMES[self._config.component]
        request = StreamRequest((component,), self._config.frequency, udp_port=port)
        self._talk = Conversation(self._config.body, request)

    def _read_tcp(self, arrivals: list[Arrival]) -> None:
        assert self._tcp is not None
        left = _MOST_PACKETS
        for _ in range(_MOST_CHUNKS):
            for kind, payload in self._stream.complete():
                self._handle(kind, payload, arrivals)
                left -= 1
                if left == 0:
                    return  # the rest waits where it is, and what comes in the socket
            try:
                data = self._tcp.recv(_CHUNK)
            except BlockingIOError:
                return
            if not data:
                raise MocapError("the server has closed the connection")
            self._heard, self._probed = time.monotonic(), None
            self._stream.put(data)

    def _handle(self, kind: PacketType, payload: bytes, arrivals: list[Arrival]) -> None:
        assert self._talk is not None
        if kind is PacketType.DATA:
            try:
                arrivals.append(Arrival(decode_data(payload)))
            except PacketError:
                self.counters.garbage += 1
        elif kind is PacketType.NO_MORE_DATA:
            self.counters.no_more_data += 1
        else:
            before = self._talk.state
            for command in self._talk.handle(kind, payload):
                self._send(command)
            if self._talk.state is State.STREAMING and before is not State.STREAMING:
                self.counters.connections += 1
                self.last_error = ""

    def _send(self, command: str) -> None:
        assert self._tcp is not None
        data = text_packet(PacketType.COMMAND, command)
        if self._tcp.send(data) != len(data):
            raise MocapError("the server takes no more commands")

    def _check_silence(self, now: float) -> None:
        timeout = self._config.timeout
        if now - self._heard <= timeout:
            return
        if self.state is not State.STREAMING:
            raise MocapError(f"no answer within {timeout} s ({self.state.value})")
        if self._probed is None:
            self._probed = now
            self._send("GetState")
        elif now - self._probed > timeout:
            raise MocapError(f"silent for {now - self._heard:.1f} s")

    def _disconnect(self, now: float, reason: str) -> None:
        self.last_error = reason[:_MOST_TEXT]
        self.counters.disconnections += self.state is State.STREAMING
        self._not_before = now + self._config.retry
        self._drop()

    def _drop(self) -> None:
        for end in (self._tcp, self._udp):
            if end is not None:
                end.close()
        self._tcp = self._udp = self._talk = None


def _refuse_error(code: int) -> None:
    if code not in (0, errno.EINPROGRESS):
        raise MocapError(f"cannot be reached: {os.strerror(code).lower()}")


def _check(config: MocapConfig) -> None:
    if config.transport not in ("udp", "tcp"):
        raise ValueError(f"camera server: transport must be udp or tcp, got '{config.transport}'")
    if config.component not in COMPONENT_NAMES:
        allowed = " or ".join(COMPONENT_NAMES)
        raise ValueError(f"camera server: component must be {allowed}, got '{config.component}'")
    if not (0 < config.port < 65536 and 0 <= config.udp_port < 65536):
        raise ChannelError(
            f"camera server: port must be 1 to 65535 and udp_port 0 to 65535, got {config.port} and "
            f"{config.udp_port}"
        )
    if config.frequency is not None and config.frequency < 1:
        raise ValueError(f"camera server: frequency must be 1 Hz or more, got {config.frequency}")
    if not (config.timeout > 0.0 and config.retry > 0.0):
        raise ValueError(
            f"camera server: timeout and retry must be positive, got {config.timeout} s and {config.retry} s"
        )
    if not config.body.strip():
        raise ValueError("camera server: the name of the body is missing")

"""One client session of the virtual camera server: replies and streamed frames."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field

from systems.link.qualisys.messages import (
    Component,
    Event,
    PacketError,
    PacketStream,
    PacketType,
    packet,
    text_of,
    text_packet,
)
from systems.link.qualisys.parameters import bodies_xml, general_xml, parameters_xml
from systems.link.qualisys.stream_request import RequestError, StreamRequest, parse_components

VERSION = (1, 27)  # newest that is spoken
_OLDEST_VERSION = (1, 8)  # before, poses were sent differently
_OUTBOX = 1 << 18  # bytes that may wait for a slow client; frames beyond are left out
_RATE_SLACK = 1e-3  # of a period: stamps are whole microseconds

NO_MORE_DATA = packet(PacketType.NO_MORE_DATA)


@dataclass
class CameraState:
    """State of the virtual camera that all clients share."""

    names: tuple[str, ...]  # of the bodies
    frequency: int  # Hz
    measuring: bool = False

    @property
    def event(self) -> Event:
        """The state as the protocol names it."""
        return Event.CONNECTED if self.measuring else Event.CONNECTION_CLOSED


@dataclass
class Session:
    """The protocol with one client; bytes in, bytes out."""

    camera: CameraState
    host: str  # the client's address
    version: str = "1.1"  # until the client asks for another
    stream: StreamRequest | None = None
    polled: tuple[Component, ...] | None = None  # the client waits for one frame of these components
    outbox: bytearray = field(default_factory=bytearray)  # for the TCP connection
    datagrams: list[tuple[bytes, tuple[str, int]]] = field(default_factory=list)
    left_out: int = 0  # frames that the client was too slow for
    _inbox: PacketStream = field(default_factory=PacketStream)
    _count: int = 0  # of frames since the stream began
    _due_us: float = -math.inf  # stamp from which the next frame is due

    def __post_init__(self) -> None:
        """Greets: without a full stop, as servers do and clients compare."""
        self._say("QTM RT Interface connected")

    def receive(self, data: bytes) -> bool:
        """Takes bytes of the client and puts the answers into the outbox; False if it has to be cut off."""
        try:
            for kind, payload in self._inbox.feed(data):
                if kind is PacketType.COMMAND:
                    self._obey(text_of(payload).split())
                else:
                    self._refuse("Parse error")
        except PacketError:
            return False
        return len(self.outbox) <= _OUTBOX

    def offer(self, time_us: int, encoded: Callable[[tuple[Component, ...]], bytes]) -> None:
        """Puts a new frame into the outbox or among the datagrams, if the client wants it."""
        if self.polled is not None:
            self.outbox += encoded(self.polled)
            self.polled = None
        if self.stream is None or not self._is_due(time_us, self.stream):
            return
        self._deliver(encoded(self.stream.components))

    def announce(self, event: Event) -> None:
        """Tells a change of state; with the end of a measurement go streams and polls that wait for it."""
        self.outbox += packet(PacketType.EVENT, bytes([event]))
        if self.camera.measuring:
            return
        if self.polled is not None:
            self.outbox += NO_MORE_DATA
            self.polled = None
        if self.stream is not None:
            self._deliver(NO_MORE_DATA)

    def _deliver(self, data: bytes) -> None:
        stream = self.stream
        if stream is None:
            return
        if stream.udp_port is not None:
            self.datagrams.append((data, (stream.udp_address or self.host, stream.udp_port)))
        elif len(self.outbox) + len(data) > _OUTBOX:
            self.left_out += 1
        else:
            self.outbox += data

    def _is_due(self, time_us: int, stream: StreamRequest) -> bool:
        self._count += 1
        if stream.frequency is None:
            return (self._count - 1) % stream.divisor == 0
        period = 1e6 / stream.frequency
        early = self._due_us - time_us
        if _RATE_SLACK * period < early <= period:
            return False
        # On the grid of the rate, unless frames come more slowly than that or their stamps began anew.
        on_grid = abs(early) < period
        self._due_us = (self._due_us if on_grid else time_us) + period
        return True

    def _say(self, text: str) -> None:
        self.outbox += text_packet(PacketType.COMMAND, text)

    def _refuse(self, text: str) -> None:
        self.outbox += text_packet(PacketType.ERROR, text)

    def _obey(self, words: list[str]) -> None:
        command, words = (words[0].lower(), words[1:]) if words else ("", [])
        answers = {
            "version": self._answer_version,
            "qtmversion": lambda _: self._say("QTM Version is 2024.1 (build 0)"),
            "byteorder": lambda _: self._say("Byte order is little endian"),
            "getstate": lambda _: self.outbox.extend(packet(PacketType.EVENT, bytes([self.camera.event]))),
            "getparameters": self._answer_parameters,
            "getcurrentframe": self._answer_frame,
            "streamframes": self._answer_stream,
        }
        try:
            answers.get(command, lambda _: self._refuse("Parse error"))(words)
        except RequestError:
            self._refuse("Parse error")

    def _answer_version(self, words: list[str]) -> None:
        if not words:
            self._say(f"Version is {self.version}")
            return
        number = re.fullmatch(r"(\d{1,3})\.(\d{1,3})", words[0])
        if number and _OLDEST_VERSION <= (int(number[1]), int(number[2])) <= VERSION:
            self.version = f"{int(number[1])}.{int(number[2])}"
            self._say(f"Version set to {self.version}")
        else:
            self._refuse("Version NOT supported")

    def _answer_parameters(self, words: list[str]) -> None:
        wanted = {word.lower() for word in words}
        blocks = []
        if wanted & {"all", "general"}:
            blocks.append(general_xml(self.camera.frequency))
        if wanted & {"all", "6d"}:
            blocks.append(bodies_xml(self.camera.names))
        if blocks:
            self.outbox += text_packet(PacketType.XML, parameters_xml(self.version, blocks))
        else:
            self._refuse("Parameters not available" if wanted else "Parse error")

    def _answer_frame(self, words: list[str]) -> None:
        components = parse_components(words)
        if self.camera.measuring:
            self.polled = components  # answered by the next frame
        else:
            self.outbox += NO_MORE_DATA

    def _answer_stream(self, words: list[str]) -> None:
        if [word.lower() for word in words] == ["stop"]:
            self.stream = None  # without a word, as servers do
            return
        request = StreamRequest.parse(words)
        if request.udp_address is not None and not self._is_own(request.udp_address):
            self._refuse("UDP address is not that of the client")
            return
        self.stream, self._count, self._due_us = request, 0, -math.inf
        if not self.camera.measuring:
            self._deliver(NO_MORE_DATA)

    def _is_own(self, address: str) -> bool:
        """Frames go to nobody who has not asked for them."""
        return address == self.host or (address.lower() == "localhost" and self.host.startswith("127."))

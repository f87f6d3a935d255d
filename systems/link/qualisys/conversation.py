"""The handshake with a Qualisys server until frames are streamed. No sockets."""

from enum import Enum

from systems.link.qualisys.messages import Event, Frame, PacketType, text_of
from systems.link.qualisys.parameters import Body, find_body, parse_bodies
from systems.link.qualisys.stream_request import StreamRequest

GREETING = "QTM RT Interface connected"  # some versions add a full stop
VERSIONS = ("1.25", "1.21", "1.17", "1.12", "1.8")  # asked for in this order; before 1.8 poses were different


class MocapError(RuntimeError):
    """The camera server cannot be used; the message gives the reason."""


class State(Enum):
    """Stages of the handshake."""

    DISCONNECTED = "disconnected"
    CONNECTING = "connecting"
    GREETING = "waiting for the greeting"
    VERSION = "agreeing on a version"
    PARAMETERS = "asking for the bodies"
    STREAMING = "streaming"


class Conversation:
    """Greeting, version, parameters, stream: one answer of the server at a time."""

    def __init__(self, body: str, request: StreamRequest) -> None:
        """A conversation that has not begun.

        Args:
            body: name of the rigid body that is wanted.
            request: which frames to ask for in the end.
        """
        self._body, self._request = body, request
        self._versions = list(VERSIONS)
        self._bodies: list[Body] = []
        self.state = State.GREETING
        self.event: Event | None = None  # what the server said of itself last

    @property
    def version(self) -> str:
        """The version of the protocol that is spoken; empty before it is agreed on."""
        return self._versions[0] if self.state in (State.PARAMETERS, State.STREAMING) else ""

    def place(self, frame: Frame) -> int | None:
        """Where the body stands in a frame; None if the frame has other bodies than the parameters name.

        A frame holds all bodies of the parameters or, from some servers, only those that are enabled.
        """
        bodies, count = self._bodies, len(frame.bodies)
        if count != len(bodies):
            bodies = [body for body in bodies if body.enabled]
        return find_body(bodies, self._body) if count == len(bodies) else None

    def handle(self, kind: PacketType, payload: bytes) -> list[str]:
        """Takes a packet that is not data; the commands that are to be sent now.

        Raises:
            MocapError: if the server refuses, or is none.
            ParameterError: if it does not have the body.
        """
        if kind is PacketType.EVENT:
            return self._handle_event(payload)
        text = text_of(payload)
        if self.state is State.GREETING:
            return self._handle_greeting(kind, text)
        if self.state is State.VERSION and kind in (PacketType.COMMAND, PacketType.ERROR):
            return self._handle_version(kind, text)
        if kind is PacketType.ERROR:
            raise MocapError(f"the server says '{text}' ({self.state.value})")
        if kind is PacketType.XML:
            return self._handle_parameters(text)
        return []

    def _handle_greeting(self, kind: PacketType, text: str) -> list[str]:
        if kind is PacketType.ERROR:
            raise MocapError(f"the server says '{text}'")
        if not text.startswith(GREETING):
            raise MocapError(f"not a Qualisys server: it says '{text[:60]}'")
        self.state = State.VERSION
        return [f"Version {self._versions[0]}"]

    def _handle_version(self, kind: PacketType, text: str) -> list[str]:
        if kind is PacketType.COMMAND and text.startswith("Version set to"):
            self.state = State.PARAMETERS
            return ["GetParameters 6D"]
        if len(self._versions) == 1:
            raise MocapError(f"the server speaks none of the versions {', '.join(VERSIONS)}: '{text}'")
        del self._versions[0]
        return [f"Version {self._versions[0]}"]

    def _handle_parameters(self, xml: str) -> list[str]:
        bodies = parse_bodies(xml)
        find_body(bodies, self._body)
        self._bodies = bodies
        if self.state is State.STREAMING:
            return []
        self.state = State.STREAMING
        return [self._request.command()]

    def _handle_event(self, payload: bytes) -> list[str]:
        try:
            self.event = Event(payload[0])
        except (ValueError, IndexError):
            return []  # one of the many that say nothing about the stream
        changed = self.event is Event.CAMERA_SETTINGS_CHANGED and self.state is State.STREAMING
        return ["GetParameters 6D"] if changed else []

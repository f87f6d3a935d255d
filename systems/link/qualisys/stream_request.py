"""The command StreamFrames: rate, transport and components."""

from dataclasses import dataclass

from systems.link.qualisys.messages import COMPONENT_NAMES, Component

# What a client may ask of a real server; what is not in COMPONENT_NAMES is left out of the frames.
_ALL_COMPONENTS = {
    *("2d", "2dlin", "3d", "3dres", "3dnolabels", "3dnolabelsres", "6d", "6dres", "6deuler", "6deulerres"),
    *("analog", "analogsingle", "force", "forcesingle", "gazevector", "eyetracker", "image", "timecode"),
    *("skeleton", "skeleton:global"),
}
_UDP_PORTS = range(1023, 65536)
_MOST_DIGITS = 6  # of a rate or a port; more say nothing that a camera could do


class RequestError(ValueError):
    """An invalid StreamFrames command."""


def parse_components(words: list[str]) -> tuple[Component, ...]:
    """The components of a request that carry poses, in the order of the request, each once.

    Raises:
        RequestError: if there is no word, or one that the protocol does not know.
    """
    words = [word.lower() for word in words]
    if not words:
        raise RequestError("a component is needed, for example 6DRes")
    if words == ["all"]:
        return tuple(COMPONENT_NAMES.values())
    # "Analog:1,2-5" names channels.
    known = {
        word for word in words if word in _ALL_COMPONENTS or word.startswith(("analog:", "analogsingle:"))
    }
    if len(known) < len(set(words)):
        raise RequestError(f"not a component: {' '.join(sorted(set(words) - known))}")
    served = {name.lower(): component for name, component in COMPONENT_NAMES.items()}
    return tuple(dict.fromkeys(served[word] for word in words if word in served))


@dataclass(frozen=True)
class StreamRequest:
    """The stream that a client asks for."""

    components: tuple[Component, ...] = (Component.POSE_RESIDUAL,)
    frequency: int | None = None  # Hz; None: every frame, or every ``divisor``-th
    divisor: int = 1
    udp_port: int | None = None  # None: over the TCP connection
    udp_address: str | None = None  # None: the address that the request comes from

    def command(self) -> str:
        """The command that asks for it."""
        rate = "AllFrames"
        if self.frequency is not None:
            rate = f"Frequency:{self.frequency}"
        elif self.divisor != 1:
            rate = f"FrequencyDivisor:{self.divisor}"
        way = []
        if self.udp_port is not None:
            way = [":".join(["UDP", *filter(None, [self.udp_address]), str(self.udp_port)])]
        names = [name for name, component in COMPONENT_NAMES.items() if component in self.components]
        return " ".join(["StreamFrames", rate, *way, *names])

    @classmethod
    def parse(cls, words: list[str]) -> "StreamRequest":
        """Reads the words after StreamFrames, in any case.

        Raises:
            RequestError: if the rate, the way or a component is not one of the protocol's.
        """
        frequency, divisor = _parse_rate(words[0].lower() if words else "")
        rest, port, address = words[1:], None, None
        if rest and rest[0].lower().startswith("udp:"):
            port, address = _parse_udp(rest[0])
            rest = rest[1:]
        return cls(parse_components(rest), frequency, divisor, port, address)


def _parse_rate(word: str) -> tuple[int | None, int]:
    kind, _, number = word.partition(":")
    if word == "allframes":
        return None, 1
    if kind in ("frequency", "frequencydivisor") and _is_number(number) and int(number) > 0:
        return (int(number), 1) if kind == "frequency" else (None, int(number))
    raise RequestError(f"'{word[:60]}' is none of AllFrames, Frequency:n, FrequencyDivisor:n")


def _parse_udp(word: str) -> tuple[int, str | None]:
    _, *address, port = word.split(":")
    if len(address) > 1 or not (_is_number(port) and int(port) in _UDP_PORTS):
        raise RequestError(f"'{word[:60]}' is not UDP:port or UDP:address:port with a port of 1023 to 65535")
    return int(port), address[0] if address else None


def _is_number(text: str) -> bool:
    return len(text) <= _MOST_DIGITS and text.isascii() and text.isdigit()

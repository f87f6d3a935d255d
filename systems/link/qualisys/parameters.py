"""The XML in which a Qualisys server describes its rigid bodies (answer to GetParameters 6D)."""

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree
from xml.sax.saxutils import escape

_LARGEST = 1 << 17  # characters; a hundred bodies need 100,000


class ParameterError(ValueError):
    """The parameters of a camera server are not XML, or lack a required element."""


@dataclass(frozen=True)
class Body:
    """A rigid body as defined on the server."""

    name: str
    enabled: bool = True  # servers since version 1.21 can leave a body out of the measurement


def parse_bodies(xml: str) -> list[Body]:
    """The bodies in the order of the data packets.

    Raises:
        ParameterError: if the text is no XML or has no block The_6D.
    """
    if len(xml) > _LARGEST:
        raise ParameterError(f"6D parameters: {len(xml)} characters, at most {_LARGEST} are read")
    # Nothing is declared in the documents of a camera: what is could grow without end.
    if "<!" in xml:
        raise ParameterError("6D parameters: declarations are not read")
    try:
        root = ElementTree.fromstring(xml)
    except (ElementTree.ParseError, ValueError) as error:
        raise ParameterError(f"6D parameters: no XML ({error})") from error
    block = root.find("The_6D")
    if block is None:
        raise ParameterError(f"6D parameters: no block The_6D in {root.tag}")
    return [
        Body(
            (element.findtext("Name") or "").strip(),
            (element.findtext("Enabled") or "true").strip().lower() != "false",
        )
        for element in block.findall("Body")
    ]


def find_body(bodies: Sequence[Body], name: str) -> int:
    """The place of a body: with exactly this name, or with this name in another case if there is only one.

    Raises:
        ParameterError: if there is none, or several differ in case only.
    """
    for wanted in (lambda body: body.name == name, lambda body: body.name.casefold() == name.casefold()):
        places = [place for place, body in enumerate(bodies) if wanted(body)]
        if len(places) == 1:
            return places[0]
        if places:
            raise ParameterError(f"body '{name}': the server has {len(places)} of this name")
    known = ", ".join(f"'{body.name}'" for body in bodies) or "none at all"
    raise ParameterError(f"body '{name}': the server does not track it; it tracks {known}")


def general_xml(frequency: int) -> str:
    """The block General, as far as a client needs it to know the frame rate in Hz."""
    return f"<General><Frequency>{frequency}</Frequency></General>"


def bodies_xml(names: Sequence[str]) -> str:
    """The block The_6D."""
    bodies = "".join(
        f"<Body><Name>{escape(name)}</Name><Enabled>true</Enabled>"
        '<Color R="255" G="255" B="255"/><Points/></Body>'
        for name in names
    )
    return f"<The_6D><Bodies>{len(names)}</Bodies>{bodies}</The_6D>"


def parameters_xml(version: str, blocks: Sequence[str]) -> str:
    """The whole document for a client that speaks the given version of the protocol."""
    return f"<QTM_Parameters_Ver_{version}>{''.join(blocks)}</QTM_Parameters_Ver_{version}>"

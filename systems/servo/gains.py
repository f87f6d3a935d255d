"""The gains of every shipped law, one group each, as a scenario has them."""

from collections.abc import Iterator, Mapping
from dataclasses import field, fields, make_dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from robots.configuration.nodes import Node
from systems.servo import LAWS
from systems.servo.law_config import LawConfig


class _ByName:
    """A dataclass whose fields are found by their names, as in a mapping.

    Attributes:
        own: what a scenario says of laws of one's own, by ``FILE.py:CLASS``.
    """

    own: Mapping[str, Node] = MappingProxyType({})

    def __getitem__(self, law: str) -> LawConfig:
        if law not in self:
            raise KeyError(law)
        return getattr(self, law)

    def __contains__(self, law: object) -> bool:
        return law in set(self)

    def __iter__(self) -> Iterator[str]:
        return (entry.name for entry in fields(self))  # pyright: ignore[reportArgumentType]


if TYPE_CHECKING:

    class LawGains(_ByName):
        """Gains and limits of each law, by its name."""
else:
    # Each law brings the class of its own, so that a scenario may say `pbvs: !Pbvs {translation: 8}` and
    # knows of every law what it may say.
    LawGains = make_dataclass(
        "LawGains",
        [(name, law.Config, field(default_factory=law.Config)) for name, law in LAWS.items()],
        bases=(_ByName,),
    )
    LawGains.__module__ = __name__  # so that a scenario can travel to other processes

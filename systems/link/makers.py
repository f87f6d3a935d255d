"""The links that a scenario can name: one class for each maker of a controller."""

from dataclasses import dataclass
from typing import ClassVar, get_args

from systems.link.abb.link import EgmSettings
from systems.link.config import LinkConfig

__all__ = ["LINK_NAMES", "AbbEgm", "RobotLinkConfig", "default_link"]


@dataclass
class AbbEgm(EgmSettings, LinkConfig):
    """An ABB controller under Externally Guided Motion."""

    kind: ClassVar[str] = "egm"


RobotLinkConfig = AbbEgm  # a further maker is one more member: AbbEgm | Another
LINK_NAMES = tuple(link.kind for link in get_args(RobotLinkConfig) or (RobotLinkConfig,))


def default_link() -> RobotLinkConfig:
    """The link that is meant where none is named."""
    return AbbEgm()

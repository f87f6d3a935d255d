"""The links that a scenario can name: one class for each maker of a controller."""

from dataclasses import dataclass
from typing import ClassVar, get_args

from systems.link.abb.link import EgmSettings
from systems.link.config import LinkConfig
from systems.link.kuka.link import RsiSettings

__all__ = ["LINK_NAMES", "AbbEgm", "KukaRsi", "RobotLinkConfig", "default_link"]


@dataclass
class AbbEgm(EgmSettings, LinkConfig):
    """An ABB controller under Externally Guided Motion."""

    kind: ClassVar[str] = "egm"
    title: ClassVar[str] = "EGM"


@dataclass
class KukaRsi(RsiSettings, LinkConfig):
    """A KUKA controller under the Robot Sensor Interface."""

    kind: ClassVar[str] = "rsi"
    title: ClassVar[str] = "RSI"


RobotLinkConfig = AbbEgm | KukaRsi  # a further maker is one more member
LINK_NAMES = tuple(link.kind for link in get_args(RobotLinkConfig))


def default_link() -> RobotLinkConfig:
    """The link that is meant where none is named."""
    return AbbEgm()

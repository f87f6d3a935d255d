"""Titles and colours of the laws, common to table, report and replay."""

import re
from collections.abc import Iterable

from systems.servo import LAWS
from systems.servo.contract import LawTraits, law_traits

_FURTHER_COLORS = ("#c2739f", "#a0522d", "#56b4e9", "#7a5195")
WANTED_COLOR = "#cc79a7"


def law_title(law: str) -> str:
    """The name of a law for people."""
    return _traits(law).title


def law_colors(laws: Iterable[str]) -> dict[str, str]:
    """One colour per law as #rrggbb; laws that have none of their own get further ones in turn."""
    unknown = 0
    colors = {}
    for law in laws:
        colour = _traits(law).colour
        if not colour:
            colour = _FURTHER_COLORS[unknown % len(_FURTHER_COLORS)]
            unknown += 1
        colors[law] = colour
    return colors


def law_file_name(law: str) -> str:
    """The name of a law without what a file or a path in a scene cannot have."""
    return re.sub(r"[^\w-]+", "_", law)


def _traits(law: str) -> LawTraits:
    """What stands on the law's class; a log may be of a law that is not there any more."""
    try:
        return law_traits(LAWS.find(law))
    except ValueError:
        return LawTraits(law.rpartition(":")[2].replace("_", " "), "")

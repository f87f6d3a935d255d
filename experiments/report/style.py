"""How laws look and what they are called, the same in the table, the report and the replay."""

from collections.abc import Iterable

TITLES = {
    "open_loop": "Open loop",
    "numerical_ik": "Numerical IK",
    "pbvs": "PBVS",
    "position_level": "Position level",
    "compensation": "Compensation",
}

# From the palette of Okabe and Ito, which colour-blind readers tell apart; the baseline is grey.
COLORS = {
    "open_loop": "#8a8f98",
    "numerical_ik": "#0f7cc0",
    "pbvs": "#d55e00",
    "position_level": "#009e73",
    "compensation": "#b89400",
}
_FURTHER_COLORS = ("#c2739f", "#a0522d", "#56b4e9", "#7a5195")
WANTED_COLOR = "#cc79a7"


def law_title(law: str) -> str:
    """The name of a law for people."""
    return TITLES.get(law, law.replace("_", " "))


def law_colors(laws: Iterable[str]) -> dict[str, str]:
    """One colour per law as #rrggbb; laws that are not shipped get further ones in turn."""
    unknown = 0
    colors = {}
    for law in laws:
        if law in COLORS:
            colors[law] = COLORS[law]
        else:
            colors[law] = _FURTHER_COLORS[unknown % len(_FURTHER_COLORS)]
            unknown += 1
    return colors

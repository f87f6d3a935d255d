"""What there is to say of a textbook example."""

from typing import Any, NamedTuple

from experiments.report.plot_page import Section


class Example(NamedTuple):
    """Numbers, a verdict, and a page."""

    numbers: dict[str, Any]  # for --json
    verdict: str
    sections: list[Section]

"""All pages of the manual that the program writes itself."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from experiments.manual.chapters import chapters
from experiments.manual.commands import command_page, commands, overview, page_name
from experiments.manual.fields import robot_page, scenario_page, shipped_page

# Chapters of the README that have no page: the manual says the same elsewhere, or only a visitor needs it.
_ELSEWHERE = {"opening", "commands", "license"}
# Entries of the table of contents that stand for generated pages.
GUIDE, COMMANDS = "<chapters of the README>", "<commands>"


@dataclass(frozen=True)
class Page:
    """One page."""

    title: str
    text: str  # Markdown


def generated_pages(app: typer.Typer, root: Path) -> dict[str, Page]:
    """Place below ``docs`` -> page.

    Args:
        app: whose commands are described.
        root: the folder of the README.

    Raises:
        OSError: if the README cannot be read.
    """
    found = {
        f"guide/{name}.md": Page(title, text)
        for name, (title, text) in chapters((root / "README.md").read_text(encoding="utf-8")).items()
        if name not in _ELSEWHERE
    }
    found["reference/commands/index.md"] = Page("Overview", overview(app))
    for name, command in commands(app):
        found[f"reference/commands/{page_name(name)}"] = Page(f"truetip {name}", command_page(name, command))
    found["reference/scenario-fields.md"] = Page("Fields of a scenario", scenario_page())
    found["reference/robot-fields.md"] = Page("Fields of a robot", robot_page())
    found["reference/shipped.md"] = Page("Shipped scenarios and robots", shipped_page())
    return found


def with_generated(contents: Sequence[Any], pages: Mapping[str, Page]) -> list[Any]:
    """A table of contents in which `GUIDE` and `COMMANDS` are replaced by the pages that they stand for."""
    stands_for = {
        GUIDE: [{page.title: place} for place, page in pages.items() if place.startswith("guide/")],
        COMMANDS: [
            {page.title: place} for place, page in pages.items() if place.startswith("reference/commands/")
        ],
    }
    found: list[Any] = []
    for entry in contents:
        if isinstance(entry, str) and entry in stands_for:
            found += stands_for[entry]
        elif isinstance(entry, dict):
            found.append(
                {
                    title: with_generated(inside, pages) if isinstance(inside, list) else inside
                    for title, inside in entry.items()
                }
            )
        else:
            found.append(entry)
    return found

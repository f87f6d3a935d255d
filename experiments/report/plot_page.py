"""Pages with plotly figures that open offline."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import plotly.graph_objects as go
from markupsafe import Markup, escape

from experiments.report.curves import thinned_figure
from experiments.report.figure_style import styled
from experiments.report.packed import later, packed
from experiments.report.page import write_page

_LONG = 60  # characters: longer cells are broken into lines
_WORD = re.compile(r"[^\W\d_]{4}|^(?!nan$|inf$)[^\W\d_]")
_CONFIG = {"responsive": True, "displayModeBar": False, "showSendToCloud": False, "plotlyServerURL": ""}


@dataclass(frozen=True)
class Section:
    """A card of the page: a heading, a line of explanation, then a figure or HTML."""

    title: str
    note: str
    content: go.Figure | str
    height: int = 480  # px, of a figure

    @property
    def html(self) -> Markup:
        """The content as it stands in the page."""
        if not isinstance(self.content, go.Figure):
            return Markup(self.content)
        figure = styled(thinned_figure(self.content), self.height)
        return later(figure.to_html(full_html=False, include_plotlyjs=False, config=_CONFIG))


def write_plot_page(path: str | Path, title: str, verdict: str, sections: Sequence[Section]) -> None:
    """Writes a self-contained page.

    Raises:
        OSError: if it cannot be written.
    """
    # Two thirds of a page are the plotting library.
    library = None if any(isinstance(section.content, go.Figure) for section in sections) else packed("")
    write_page(path, "plot_page.html", library, title=title, verdict=verdict, sections=sections)


def html_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; cells are text unless they are marked as HTML. In the page it sorts by a click on a head."""
    return f"<div class=scroll tabindex=0><table>{_inside(head, rows)}</table></div>"


def sortable_table(
    name: str, head: Sequence[str], rows: Sequence[Sequence[str]], has_filter: bool = False
) -> str:
    """A long table that scrolls below its head, with a name for the file that its button saves.

    Args:
        name: of the file, without its suffix; unlike all others of the page.
        head: names of the columns.
        rows: cells, text unless they are marked as HTML.
        has_filter: whether a field above it hides the rows without the words that are typed there.
    """
    table = f'<table id="{name}">{_inside(head, rows)}</table>'
    filter_field = f'<input class=filter data-table="{name}" placeholder="Filter" aria-label="Filter"> '
    return f'{filter_field if has_filter else ""}<div class="scroll tall" tabindex="0">{table}</div>'


def _inside(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns of words begin at the left, those of numbers end at the right."""
    classes = [" class=word" * (k > 0 and _has_words([row[k] for row in rows])) for k in range(len(head))]
    cells = [
        "".join(
            f"<td{_broken(cell, kind)}>{escape(cell)}</td>" for kind, cell in zip(classes, row, strict=True)
        )
        for row in rows
    ]
    titles = "".join(f"<th{kind}>{escape(name)}</th>" for kind, name in zip(classes, head, strict=True))
    lines = "".join(f"<tr>{line}</tr>" for line in cells)
    return f"<thead><tr>{titles}</tr></thead><tbody>{lines}</tbody>"


def _has_words(cells: Sequence[str]) -> bool:
    return any(_WORD.search(_seen(cell)) for cell in cells)


def _broken(cell: str, kind: str) -> str:
    return " class=text" if kind and len(_seen(cell)) > _LONG else kind


def _seen(cell: str) -> str:
    return cell.striptags() if isinstance(cell, Markup) else cell

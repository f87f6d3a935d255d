"""Pages with plotly figures that open offline."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import plotly.graph_objects as go
from markupsafe import Markup, escape

from experiments.report.curves import thinned_figure
from experiments.report.figure_style import TEMPLATE
from experiments.report.packed import later
from experiments.report.page import write_page

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
        figure = thinned_figure(self.content)
        figure.update_layout(height=self.height, template=TEMPLATE)
        return later(figure.to_html(full_html=False, include_plotlyjs=False, config=_CONFIG))


def write_plot_page(path: str | Path, title: str, verdict: str, sections: Sequence[Section]) -> None:
    """Writes a self-contained page.

    Raises:
        OSError: if it cannot be written.
    """
    write_page(path, "plot_page.html", title=title, verdict=verdict, sections=sections)


def html_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; cells are text unless they are marked as HTML."""
    return f"<div class=scroll tabindex=0><table>{_inside(head, rows)}</table></div>"


def sortable_table(
    name: str, head: Sequence[str], rows: Sequence[Sequence[str]], has_filter: bool = False
) -> str:
    """A long table that sorts by a click on a head, with a button that saves it.

    Args:
        name: of the file, without its suffix; unlike all others of the page.
        head: names of the columns.
        rows: cells, text unless they are marked as HTML.
        has_filter: whether a field above it hides the rows without the words that are typed there.
    """
    button = f'<button class=csv data-table="{name}">Save as CSV</button>'
    table = f'<table class=sortable id="{name}">{_inside(head, rows)}</table>'
    filter_field = f'<input class=filter data-table="{name}" placeholder="Filter" aria-label="Filter"> '
    return f'{filter_field if has_filter else ""}{button}<div class="scroll tall" tabindex="0">{table}</div>'


def _inside(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    cells = ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows]
    titles = "".join(f"<th>{escape(name)}</th>" for name in head)
    lines = "".join(f"<tr>{line}</tr>" for line in cells)
    return f"<thead><tr>{titles}</tr></thead><tbody>{lines}</tbody>"

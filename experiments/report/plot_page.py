"""Pages with plotly figures that open offline."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from experiments.report.files import write_text
from experiments.report.page import page

_CONFIG = {"responsive": True, "displayModeBar": False}


@dataclass(frozen=True)
class Section:
    """A card of the page: a heading, a line of explanation, then a figure or HTML."""

    title: str
    note: str
    content: go.Figure | str
    height: int = 480  # px, of a figure


def write_plot_page(path: str | Path, title: str, verdict: str, sections: Sequence[Section]) -> None:
    """Writes a self-contained page.

    Raises:
        OSError: if it cannot be written.
    """
    # The library stands before the figures, whose scripts call it as soon as they are read.
    body = [f"<script>{get_plotlyjs()}</script>"]
    body.append(f"<header><p class=eyebrow>truetip</p><h1>{escape(title)}</h1>")
    body.append(f"<p class=verdict>{escape(verdict)}</p></header>")
    for section in sections:
        content = section.content
        if isinstance(content, go.Figure):
            content.update_layout(
                height=section.height,
                margin={"l": 60, "r": 20, "t": 20, "b": 50},
                paper_bgcolor="rgba(0,0,0,0)",
                plot_bgcolor="rgba(0,0,0,0)",
                font={"color": "#7a8696"},
            )
            content = content.to_html(full_html=False, include_plotlyjs=False, config=_CONFIG)
        note = f"<p class=note>{escape(section.note)}</p>" if section.note else ""
        body.append(f"<section class=card><h2>{escape(section.title)}</h2>{note}{content}</section>")
    write_text(path, page(escape(title), "\n".join(body), "", "{}", ""))


def html_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; all cells are text."""
    cells = ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows]
    titles = "".join(f"<th>{escape(name)}</th>" for name in head)
    lines = "".join(f"<tr>{line}</tr>" for line in cells)
    return f"<div class=scroll><table><thead><tr>{titles}</tr></thead><tbody>{lines}</tbody></table></div>"

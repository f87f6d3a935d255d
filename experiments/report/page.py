"""Pages: templates in `assets`, filled in and written as one file that opens offline."""

from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from experiments.report.files import write_text
from experiments.report.packed import packed, packed_plotly

# Everything that is not marked as HTML is escaped; a name that a template knows and nobody gives is an error.
_ENVIRONMENT = Environment(
    loader=PackageLoader("experiments.report", "assets"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_ENVIRONMENT.filters["packed"] = packed
_ENVIRONMENT.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}


def write_page(path: str | Path, template: str, library: Markup | None = None, **context: Any) -> None:
    """Writes a page, atomically.

    Args:
        path: where to.
        template: a file of `assets` that extends ``page.html``.
        library: a packed script that the page needs; None for the plotting library.
        context: what the template names, and ``title``.

    Raises:
        OSError: if the folder is missing or cannot be written.
        ValueError: if a number of the data is NaN or infinite.
        jinja2.UndefinedError: if the template needs something else.
    """
    page = _ENVIRONMENT.get_template(template).render(library=library or packed_plotly(), **context)
    write_text(path, page)

"""A hook of MkDocs: adds the pages that the program writes itself, and puts all pages in their order.

MkDocs calls `on_config`, `on_files` and `on_page_content`; ``mkdocs.yml`` names this file.
"""

from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

from experiments.main import app
from experiments.manual.formulas import with_mathml
from experiments.manual.pages import generated_pages, with_generated

_ROOT = Path(__file__).resolve().parents[2]


def on_config(config: Any) -> Any:
    """Completes the table of contents with the pages that are generated."""
    config.nav = with_generated(config.nav, generated_pages(app, _ROOT))
    return config


def on_files(files: Files, config: Any) -> Files:
    """Adds the generated pages to those that are written by hand."""
    for place, page in generated_pages(app, _ROOT).items():
        files.append(File.generated(config, place, content=page.text))
    return files


def on_page_content(html: str, page: Any, config: Any, files: Files) -> str:
    """Draws the formulas of a page."""
    try:
        return with_mathml(html)
    except ValueError as error:
        raise PluginError(f"{page.file.src_path}: {error}") from error

"""A hook of MkDocs: adds the pages that the program writes itself, and puts all pages in their order.

MkDocs calls `on_config` and `on_files`; ``mkdocs.yml`` names this file.
"""

from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

from experiments.main import app
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

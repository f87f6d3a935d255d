"""Chapters of the README as pages of the manual, so that nothing is written twice."""

import re

_HEADING = re.compile(r"^## (.+)$", re.MULTILINE)
_LINK = re.compile(r"\]\((?!https?://|#)([^)]+)\)")
_PAGE = re.compile(r"`docs/([\w/-]+\.md)`")


def chapters(readme: str) -> dict[str, tuple[str, str]]:
    """File name -> title and Markdown of each chapter; the opening of the README has an empty title.

    Links lead from ``docs/guide`` to where the README's lead from the root, and a page of ``docs`` that is
    named becomes a link.
    """
    starts = list(_HEADING.finditer(readme))
    ends = [*(each.start() for each in starts[1:]), len(readme)]
    found = {"opening": ("", _moved(readme[: starts[0].start()]))}
    for heading, end in zip(starts, ends, strict=True):
        title = heading.group(1)
        found[slug(title)] = (title, f"# {title}\n" + _moved(readme[heading.end() : end]))
    return found


def slug(title: str) -> str:
    """A file name for a title: ``Elastic robots and feedforward`` becomes elastic-robots-and-feedforward."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")


def _moved(text: str) -> str:
    text = _LINK.sub(lambda link: f"]({_target(link.group(1))})", text)
    return _PAGE.sub(lambda page: f"[{page.group(1)}](../{page.group(1)})", text)


def _target(place: str) -> str:
    return f"../{place.removeprefix('docs/')}"

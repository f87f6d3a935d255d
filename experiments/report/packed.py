"""Texts that a page carries compressed: the plotting library and the numbers of the plots.

A browser unpacks them itself (`unpack.js`). gzip leaves a third of the library and of most numbers, base 85
adds a quarter; it has no slash, so that nothing in it ends a script.
"""

import base64
import gzip
import re
from functools import cache

from markupsafe import Markup
from plotly.offline import get_plotlyjs

_SCRIPT = re.compile(r"<script(?: type=\"text/javascript\")?>(.*?)</script>", re.DOTALL)


def packed(text: str) -> Markup:
    """A text for an element of class ``packed``; the same text gives the same bytes."""
    return Markup(base64.b85encode(gzip.compress(text.encode(), mtime=0)).decode())


@cache
def packed_plotly() -> Markup:
    """The plotting library."""
    return packed(get_plotlyjs())


def later(html: str) -> Markup:
    """HTML whose scripts are packed, and run when the plotting library is there."""
    return Markup(_SCRIPT.sub(_packed_script, html))


def _packed_script(script: re.Match[str]) -> str:
    return f'<script type="text/plain" class="packed later">{packed(script.group(1))}</script>'

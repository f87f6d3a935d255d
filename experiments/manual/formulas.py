"""Formulas of pages as MathML, which browsers draw without a script, a font or the network."""

import html
import re

from latex2mathml.converter import convert

# What the extension arithmatex leaves of $...$ and $$...$$.
_FORMULA = re.compile(
    r'<(?P<tag>span|div) class="arithmatex">\\[(\[](?P<tex>.*?)\\[)\]]</(?P=tag)>', re.DOTALL
)
# What the converter does not know it leaves as it is: commands, and the columns of environments.
_UNKNOWN = re.compile(r"\\[a-zA-Z]+|&")


def with_mathml(page: str) -> str:
    """HTML whose formulas are MathML; a wide one scrolls within itself.

    Raises:
        ValueError: if a formula uses a command that has no MathML.
    """
    return _FORMULA.sub(_drawn, page)


def _drawn(found: re.Match[str]) -> str:
    tex, is_display = html.unescape(found["tex"]).strip(), found["tag"] == "div"
    math = convert(tex, display="block" if is_display else "inline")
    unknown = _UNKNOWN.search(html.unescape(re.sub(r"<[^>]*>", " ", math)))
    if unknown:
        raise ValueError(f"formula {tex}: {unknown.group()} has no MathML")
    math = math.replace("<math ", f'<math alttext="{html.escape(tex)}" ', 1)
    # Kept out of the search, which would find letters without their places.
    return f'<{found["tag"]} class="formula" data-search-exclude>{math}</{found["tag"]}>'

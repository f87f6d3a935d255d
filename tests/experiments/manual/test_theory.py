"""The theory of the manual: each formula says where it is from, and names code and a test that exist."""

import importlib
import re
from pathlib import Path

import markdown
import pytest

from experiments.manual.formulas import with_mathml

ROOT = Path(__file__).resolve().parents[3]
THEORY = ROOT / "docs" / "theory"
PAGES = sorted(path.stem for path in THEORY.glob("*.md") if path.stem != "index")
DISPLAYED = re.compile(r"^\$\$\n.*?^\$\$\n\n(?P<below>[^\n]*)\n(?P<style>[^\n]*)", re.DOTALL | re.MULTILINE)
SOURCE = re.compile(r"Source: (?P<source>.+?) Code: `(?P<code>[\w.]+)`\. Test: `(?P<test>[\w/.]+::\w+)`\.")
# A place in one of the three; another source by its section or year; our own; or what any textbook has.
KNOWN = (
    r"\b[PRW] (\(\d+(\.\d+)?[a-z]?\)|section|sections|chapter|appendix|figure)",
    r"\((19|20)\d\d\)",
    r"ISO/TS 15066:2016, section|ISO 9283",
    r"JCGM 100:2008, section",
    r"[Oo]wn derivation",
    r"inverse dynamics|Dahl's model|chi squared|[Cc]hain rule|[Rr]ecursive least squares",
    r"parabola through three points|polynomial of fifth degree",
)


def formulas(page: str) -> list[re.Match[str]]:
    return list(DISPLAYED.finditer((THEORY / f"{page}.md").read_text(encoding="utf-8")))


def named(path: str) -> object:
    """What a dotted path names: the longest part of it that is a module, then attributes."""
    parts = path.split(".")
    for end in range(len(parts), 0, -1):
        try:
            found: object = importlib.import_module(".".join(parts[:end]))
        except ModuleNotFoundError:
            continue
        for name in parts[end:]:
            found = getattr(found, name)
        return found
    raise ModuleNotFoundError(path)


@pytest.mark.parametrize("page", PAGES)
def test_every_displayed_formula_has_a_source_code_and_a_test(page: str):
    text, found = (THEORY / f"{page}.md").read_text(encoding="utf-8"), formulas(page)
    assert 2 * len(found) == len(re.findall(r"^\$\$$", text, re.MULTILINE))
    assert found
    for formula in found:
        line = SOURCE.fullmatch(formula["below"])
        assert line, formula["below"]
        assert formula["style"] == "{ .source }"
        assert any(re.search(known, line["source"]) for known in KNOWN), line["source"]
        assert named(line["code"]) is not None
        place, _, name = line["test"].partition("::")
        assert f"def {name}(" in (ROOT / place).read_text(encoding="utf-8"), line["test"]


@pytest.mark.parametrize("page", PAGES)
def test_what_the_text_names_exists(page: str):
    text = (THEORY / f"{page}.md").read_text(encoding="utf-8")
    tests = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    for name in re.findall(r"`(test_\w+)`", text):
        assert f"def {name}(" in tests, name
    for path in re.findall(r"`((?:robots|systems|diagrams|experiments)\.[\w.]+)`", text):
        assert named(path) is not None
    for place in re.findall(r"`(tests/[\w/]+\.py)`", text):
        assert (ROOT / place).is_file(), place


@pytest.mark.parametrize("page", [*PAGES, "index"])
def test_every_formula_can_be_set(page: str):
    text = (THEORY / f"{page}.md").read_text(encoding="utf-8")
    assert not re.findall(r"[^\n\x20-\x7e\xa0-\uffff]", text)  # a tab where \tau was meant
    arithmatex = "pymdownx.arithmatex"
    html = markdown.markdown(text, extensions=[arithmatex], extension_configs={arithmatex: {"generic": True}})
    drawn = with_mathml(html)
    assert "arithmatex" not in drawn
    assert drawn.count("<math") >= len(formulas(page))


def test_the_contents_name_every_page_of_the_theory():
    contents = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    named_there = set(re.findall(r"theory/([\w-]+)\.md", contents))
    assert named_there == {*PAGES, "index"}
    index = (THEORY / "index.md").read_text(encoding="utf-8")
    assert not [page for page in PAGES if f"({page}.md)" not in index]


def test_a_formula_becomes_mathml_that_says_the_same():
    drawn = with_mathml('<p>a <span class="arithmatex">\\(q &lt; \\frac{1}{2}\\)</span></p>')
    assert drawn.startswith(
        '<p>a <span class="formula" data-search-exclude><math alttext="q &lt; \\frac{1}{2}"'
    )
    assert "<mfrac><mrow><mn>1</mn></mrow><mrow><mn>2</mn></mrow></mfrac>" in drawn
    block = with_mathml('<div class="arithmatex">\\[\nx\n\\]</div>')
    assert 'display="block"' in block
    assert block.endswith("</math></div>")


def test_a_command_without_mathml_is_refused():
    with pytest.raises(ValueError, match=r"\\unheardof has no MathML"):
        with_mathml('<span class="arithmatex">\\(\\unheardof x\\)</span>')
    with pytest.raises(ValueError, match="& has no MathML"):
        with_mathml('<span class="arithmatex">\\(\\begin{aligned} a &amp;= b \\end{aligned}\\)</span>')


def test_text_without_formulas_stays_as_it_is():
    page = "<p>costs $5 and `$HOME`, <code>\\(x\\)</code></p>"
    assert with_mathml(page) == page

"""Tables of a page: a click on a head sorts, buttons copy and save what is seen."""

import re
from pathlib import Path

import pytest

from experiments.report.plot_page import Section, html_table, sortable_table, write_plot_page
from tests.experiments.browser import open_page

ROWS = [["p1", "10.5", "a, b"], ["p2", "9", ""], ["p3", "-3e-2", 'say "hi" <b>']]
AMOUNTS = [["12.5 ± 0.2"], ["–"], ["<0.01"], ["9 mm"]]
DAYS = [["2026-11-02 10:00"], ["2026-10-30 09:00"]]
GROUPS = """<div class=scroll><table id=groups><thead><tr><th>law<th>mm</tr></thead><tbody>
<tr class=kind><td colspan=2>largest</tr><tr><td>a<td>2</tr><tr><td>b<td>1</tr>
<tr class=kind><td colspan=2>static</tr><tr><td>a<td>4</tr><tr><td>b<td>3</tr></tbody></table></div>"""
CLICKS = """<script>
function show(name, table, separator) {
  const seen = document.createElement("pre");
  seen.id = name; seen.textContent = tableText(table, separator); document.body.append(seen);
}
function click(name, table, column) { table.tHead.rows[0].cells[column].click(); show(name, table); }
const table = id => document.getElementById(id), [amounts, days] = document.querySelectorAll(".plain table");
</script>"""


def shown(folder: Path, table: str, script: str) -> dict[str, str]:
    page = folder / "page.html"
    write_plot_page(page, "Page", "", [Section("Poses", "", table)])
    page.write_text(page.read_text().replace("</body>", f"{CLICKS}<script>{script}</script></body>"))
    opened = open_page(page, 2000)
    assert not [line for line in opened.console if "Error" in line]
    return dict(re.findall(r'<pre id="(\w+)">(.*?)</pre>', opened.dom, re.DOTALL))


@pytest.mark.slow
def test_a_click_sorts_numbers_as_numbers_and_the_text_is_csv(tmp_path: Path):
    table = sortable_table("poses", ["name", "mm", "remark"], ROWS)
    script = 'click("rising", table("poses"), 1); click("falling", table("poses"), 1); '
    seen = shown(
        tmp_path, table, script + 'click("named", table("poses"), 0); show("copied", table("poses"), "\\t")'
    )
    order = {name: re.findall(r"^p\d", text, re.MULTILINE) for name, text in seen.items()}
    assert order["rising"] == ["p3", "p2", "p1"]
    assert order["falling"] == order["named"] == ["p1", "p2", "p3"]
    assert seen["named"].splitlines()[1] == 'p1,10.5,"a, b"'
    assert seen["named"].splitlines()[3] == 'p3,-3e-2,"say ""hi"" &lt;b&gt;"'
    assert seen["copied"].splitlines()[1] == "p1\t10.5\ta, b"


@pytest.mark.slow
def test_amounts_with_units_sort_by_size_what_is_none_comes_last_and_days_in_their_order(tmp_path: Path):
    table = f"<div class=plain>{html_table(['mm'], AMOUNTS)}{html_table(['day'], DAYS)}</div>"
    clicks = 'click("up", amounts, 0); click("down", amounts, 0); click("days", days, 0)'
    seen = shown(tmp_path, table, clicks)
    assert seen["up"].splitlines()[1:] == ["&lt;0.01", "9 mm", "12.5 ± 0.2", "–"]
    assert seen["down"].splitlines()[1:] == ["12.5 ± 0.2", "9 mm", "&lt;0.01", "–"]
    assert seen["days"].splitlines()[1:] == ["2026-10-30 09:00", "2026-11-02 10:00"]


@pytest.mark.slow
def test_rows_stay_below_their_heading_and_every_table_can_be_copied_and_saved(tmp_path: Path):
    script = 'click("sorted", table("groups"), 1); document.querySelector(".of-table").id = "buttons"'
    seen = shown(tmp_path, GROUPS, script)
    assert seen["sorted"].split() == ["law,mm", "largest", "b,1", "a,2", "static", "b,3", "a,4"]
    dom = open_page(tmp_path / "page.html", 2000).dom
    assert re.search(r'id="buttons"><button[^>]*>Copy</button><button[^>]*>CSV</button>', dom)

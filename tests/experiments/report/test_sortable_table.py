"""Long tables of a page: a click on a head sorts, a button saves what is seen."""

import re
from pathlib import Path

from experiments.report.plot_page import Section, sortable_table, write_plot_page
from tests.experiments.browser import open_page

ROWS = [["p1", "10.5", "a, b"], ["p2", "9", ""], ["p3", "-3e-2", 'say "hi" <b>']]
CLICKS = """<script>
const poses = document.getElementById("poses"), heads = [...poses.tHead.rows[0].cells];
function show(name) {
  const seen = document.createElement("pre");
  seen.id = name; seen.textContent = tableText(poses); document.body.append(seen);
}
heads[1].click(); show("rising"); heads[1].click(); show("falling"); heads[0].click(); show("named");
</script>"""


def test_a_click_sorts_numbers_as_numbers_and_the_text_is_csv(tmp_path: Path):
    page = tmp_path / "page.html"
    table = sortable_table("poses", ["name", "mm", "remark"], ROWS)
    write_plot_page(page, "Page", "", [Section("Poses", "", table)])
    page.write_text(page.read_text().replace("</body>", CLICKS + "</body>"))
    opened = open_page(page, 2000)
    assert not [line for line in opened.console if "Error" in line]
    shown = dict(re.findall(r'<pre id="(\w+)">(.*?)</pre>', opened.dom, re.DOTALL))
    order = {name: re.findall(r"^p\d", text, re.MULTILINE) for name, text in shown.items()}
    assert order == {"rising": ["p3", "p2", "p1"], "falling": ["p1", "p2", "p3"], "named": ["p1", "p2", "p3"]}
    assert shown["named"].splitlines()[1] == 'p1,10.5,"a, b"'
    assert shown["named"].splitlines()[3] == 'p3,-3e-2,"say ""hi"" &lt;b&gt;"'

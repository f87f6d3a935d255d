"""Pages in a browser: legible for everyone (axe-core, WCAG AA), as wide as the screen, without the network.

axe-core comes from npm: `npm install --no-save axe-core` puts it where this test looks.
"""

from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest

from experiments.drivetrain.figures import efficiency_figure, friction_figure
from experiments.metrics.run_metrics import summary, timing
from experiments.replay.replay import write_replay
from experiments.report.plot_page import Section, html_table, sortable_table, write_plot_page
from experiments.report.report import write_report
from robots.description.model import load_robot
from tests.experiments.browser_session import browser
from tests.experiments.synthetic import comparison

pytestmark = [pytest.mark.slow, pytest.mark.real_time]

AXE = Path(__file__).parents[3] / "node_modules" / "axe-core" / "axe.min.js"
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]
VIEWS = {"desk": (1400, 900, False), "dark": (1400, 900, True), "phone": (390, 800, False)}
UNTITLED = """[...document.querySelectorAll(".js-plotly-plot")].flatMap(plot =>
  Object.entries(plot._fullLayout).filter(([name, axis]) => /^[xy]axis/.test(name) && axis.visible
    && axis.type !== "category" && axis.showticklabels !== false && !axis.matches && !axis.title.text)
  .map(([name]) => plot.id + " " + name))"""
# Words that do not lie within their figure: nobody can read them.
CUT = """[...document.querySelectorAll(".js-plotly-plot")].flatMap(plot => {
  const all = plot.getBoundingClientRect();
  return [...plot.querySelectorAll(".main-svg text")].filter(text => text.textContent.trim()).filter(text => {
    const box = text.getBoundingClientRect();
    return box.width && (box.left < all.left - 2 || box.right > all.right + 2 || box.top < all.top - 2
      || box.bottom > all.bottom + 2);
  }).map(text => text.textContent);
})"""
WIDE_ROW = ["a long cell of many words, " * 4] * 6


@pytest.fixture(scope="module")
def tab():
    if not AXE.is_file():
        pytest.skip(f"axe-core is not in {AXE.parent} (npm install --no-save axe-core)")
    with browser() as session:
        yield session


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    robot, logs = load_robot("irb1200"), comparison(with_joints=True)
    write_report(folder / "report.html", "a: 1\n", summary("misaligned", logs), timing(logs), logs, robot)
    write_replay(folder / "replay.html", robot, {law: cycles[0] for law, cycles in logs.items()})
    points = np.random.default_rng(0).normal(size=(3, 20))
    space = go.Figure(go.Scatter3d(x=points[0], y=points[1], z=points[2], mode="markers"))
    sections = [
        Section("Friction", "What one should see.", friction_figure().update_yaxes(title="torque in N m")),
        Section("Efficiency", "", efficiency_figure()),
        Section("Space", "", space),
        Section("Table", "", html_table(["name"] * 6, [WIDE_ROW])),
        Section("Long table", "", sortable_table("long", ["name"] * 6, [WIDE_ROW] * 40, has_filter=True)),
    ]
    write_plot_page(folder / "plots.html", "Plots", "A result in a sentence.", sections)
    return folder


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("page", ["report", "plots", "replay"])
def test_a_page_can_be_read_by_everyone_on_every_screen(tab, pages: Path, page: str, view: str):
    tab.requests.clear()
    tab.complaints.clear()
    tab.view(*VIEWS[view])
    tab.open(pages / f"{page}.html")
    tab.run("document.querySelectorAll('details').forEach(fold => { fold.open = true; })")
    tab.run("new Promise(done => setTimeout(done, 300))")
    assert tab.run("document.documentElement.scrollWidth") <= VIEWS[view][0]
    tab.run(AXE.read_text(encoding="utf-8"))
    found = tab.run(
        f"axe.run(document, {{runOnly: {RULES}}}).then(result => result.violations.map(rule => "
        "rule.id + ': ' + rule.nodes.slice(0, 3).map(node => node.target.join(' ')).join(', ')))"
    )
    assert found == []
    assert tab.run(UNTITLED) == []
    assert tab.run(CUT) == []
    assert tab.complaints == []
    assert all(address.startswith(("file:", "data:", "blob:")) for address in tab.requests)

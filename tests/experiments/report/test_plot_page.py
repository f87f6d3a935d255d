"""Pages of figures and tables: words left, numbers right, whole numbers on axes, no idle weight."""

import plotly.graph_objects as go
import pytest

from experiments.report.figure_style import styled
from experiments.report.plot_page import Section, html_table, write_plot_page


def column(table: str, number: int) -> list[str]:
    """The cells of a column with their tags, head first."""
    return [line.split("</td>" if "<td" in line else "</th>")[number] for line in table.split("<tr>")[1:]]


@pytest.mark.parametrize("word", ["pbvs", "0.1 px for each marker", "yes", "no", "Nm/rad"])
def test_a_column_with_a_word_begins_at_the_left(word: str):
    table = html_table(["name", "what"], [["a", "1.5"], ["b", word]])
    assert all("class=word" in cell for cell in column(table, 1))


@pytest.mark.parametrize(
    "number", ["1.5", "-3e-10", "nan", "", "-", "3000.0 ± 0.1", "12.5 %", "0.4 ms", "-1 -2 2 0"]
)
def test_a_column_of_numbers_ends_at_the_right(number: str):
    table = html_table(["name", "mm"], [["a", "1.5"], ["b", number]])
    assert not any("class" in cell for cell in column(table, 1))


def test_a_long_cell_is_broken_into_lines():
    command = "truetip compare --scenario misaligned --laws pbvs --set station.payload=3"
    assert f"<td class=text>{command}</td>" in html_table(["row", "command"], [["1", command]])


def test_a_page_without_figures_does_not_carry_the_plotting_library(tmp_path):
    table, plots = (tmp_path / name for name in ("table.html", "plots.html"))
    sections = [Section("Table", "", html_table(["a"], [["1"]]))]
    write_plot_page(table, "Table", "", sections)
    write_plot_page(plots, "Plots", "", [*sections, Section("Plot", "", go.Figure(go.Scatter(y=[1])))])
    assert table.stat().st_size < 50_000 < plots.stat().st_size


@pytest.mark.parametrize("kind", ["log", "linear"])
def test_logarithmic_axes_write_numbers_out_between_decades(kind: str):
    figure = styled(go.Figure(go.Scatter(y=[0.2, 0.5])).update_yaxes(type=kind), 300)
    assert figure.to_dict()["layout"]["yaxis"].get("tickformat") == ("~g" if kind == "log" else None)

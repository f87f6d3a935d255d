"""The scripts of the manual run as they are printed, and find what the text says."""

import json
import re
import runpy
from pathlib import Path

import plotly.graph_objects as go
import pytest

DOCS = Path(__file__).resolve().parents[3] / "docs"
SAID = {
    "first_comparison": r"pbvs: largest [\d.]+ mm, at rest 0\.\d+ mm along an axis",
    "calibrate_from_table": r"and 0\.0\d+ mm after",  # the noise of tracker and joints leaves 0.06 mm
    "elastic_plant": r"largest deflection of the gears in degrees: \[0\. +0\.0\d+",
    "own_urdf": r"\d\d parts of its robot file are assumed",
    "only_camera": r"100 poses, standard deviation .* in micrometres: \[1\d\.\d 2\d\.\d [12]\d\.\d\]",
    "feedforward_own_path": r"by up to \[0\.0\d+ 0\.0\d+ .* degrees\ntorques .* up to \[\d{3}\. ",
    "cell_over_udp": r"largest error \d+\.\d\d mm.*\n.*'ended': 'path'",
    "study_on_a_cluster": r"0\.0 kg: largest \d+\.\d+ mm\n3\.5 kg.*\n7\.0 kg: largest \d+\.\d+ mm",
}


# Laws run in processes of their own, which import everything anew; the cell runs in real time.
DEAR = {"first_comparison", "cell_over_udp", "study_on_a_cluster"}
NOTEBOOKS = {
    "first_comparison": r"pbvs: largest [\d.]+ mm",
    "elastic_plant": r"largest deflection of a gear 0\.\d+ degrees",
}


def slow_if_dear(name: str) -> object:
    marks = [pytest.mark.slow] * (name in DEAR) + [pytest.mark.real_time] * (name == "cell_over_udp")
    return pytest.param(name, marks=marks)


@pytest.mark.parametrize("name", [slow_if_dear(name) for name in SAID])
def test_a_tutorial_runs_and_says_what_it_found(name: str, capsys: pytest.CaptureFixture[str]):
    runpy.run_path(str(DOCS / "tutorials" / f"{name}.py"), run_name="__main__")
    assert re.search(SAID[name], capsys.readouterr().out)


@pytest.mark.parametrize("name", [slow_if_dear(name) for name in NOTEBOOKS])
def test_the_cells_of_a_notebook_run_one_after_the_other(name: str, capsys: pytest.CaptureFixture[str]):
    notebook = json.loads((DOCS / "tutorials" / f"{name}.ipynb").read_text(encoding="utf-8"))
    names: dict[str, object] = {}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []  # nobody's old results
            exec("".join(cell["source"]), names)
    assert re.search(NOTEBOOKS[name], capsys.readouterr().out)
    assert isinstance(names["figure"], go.Figure)


def test_the_manual_shows_every_tutorial_as_it_is():
    page = (DOCS / "tutorials.md").read_text()
    scripts = {path.stem for path in (DOCS / "tutorials").glob("*.py")}
    assert scripts == set(SAID) == set(re.findall(r'--8<-- "docs/tutorials/(\w+)\.py"', page))


def test_there_are_twelve_tasks_for_newcomers():
    rows = re.findall(r"^\| (\d+) \|", (DOCS / "newcomer-tasks.md").read_text(), re.MULTILINE)
    assert rows == [str(number) for number in range(1, 13)]

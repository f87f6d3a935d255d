"""The scripts of the manual run as they are printed, and find what the text says."""

import re
import runpy
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[3] / "docs"
SAID = {
    "first_comparison": r"pbvs: largest [\d.]+ mm, at rest 0\.\d+ mm along an axis",
    "calibrate_from_table": r"and 0\.0\d+ mm after",  # the noise of tracker and joints leaves 0.06 mm
    "elastic_plant": r"largest deflection of the gears in degrees: \[0\. +0\.0\d+",
    "own_urdf": r"\d\d parts of its robot file are assumed",
}


# Laws run in a process of their own, which imports everything anew.
DEAR = pytest.param("first_comparison", marks=pytest.mark.slow)


@pytest.mark.parametrize("name", [DEAR, *list(SAID)[1:]])
def test_a_tutorial_runs_and_says_what_it_found(name: str, capsys: pytest.CaptureFixture[str]):
    runpy.run_path(str(DOCS / "tutorials" / f"{name}.py"), run_name="__main__")
    assert re.search(SAID[name], capsys.readouterr().out)


def test_the_manual_shows_every_tutorial_as_it_is():
    page = (DOCS / "tutorials.md").read_text()
    scripts = {path.stem for path in (DOCS / "tutorials").glob("*.py")}
    assert scripts == set(SAID) == set(re.findall(r'--8<-- "docs/tutorials/(\w+)\.py"', page))


def test_there_are_twelve_tasks_for_newcomers():
    rows = re.findall(r"^\| (\d+) \|", (DOCS / "newcomer-tasks.md").read_text(), re.MULTILINE)
    assert rows == [str(number) for number in range(1, 13)]

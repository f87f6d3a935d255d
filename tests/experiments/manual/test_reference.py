"""The reference of the manual: it leaves out no command, no option and no field, and links lead somewhere."""

import re
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from diagrams.scenario.scenario import Scenario, load_scenario, scenario_text, shipped_scenarios
from diagrams.scenario.scenario_file import read_scenario_nodes, stated_keys
from experiments.main import app
from experiments.manual.chapters import chapters
from experiments.manual.commands import commands
from experiments.manual.pages import COMMANDS, Page, generated_pages, with_generated
from robots.configuration.meaning import meanings
from robots.description.model import load_robot, shipped_robots
from tests.experiments.commands import truetip

ROOT = Path(__file__).resolve().parents[3]
TAG = re.compile(r"\(!\w+\)|\[\]")


@pytest.fixture(scope="module")
def pages() -> dict[str, Page]:
    return generated_pages(app, ROOT)


def test_every_command_has_a_page_with_all_its_options(pages: dict[str, Page]):
    found = dict(commands(app))
    assert {"compare", "cameras study", "robots", "robots import"} <= set(found)
    for name, command in found.items():
        page = pages[f"reference/commands/{name.replace(' ', '-')}.md"].text
        names = [
            each for option in command.params if option.param_type_name == "option" for each in option.opts
        ]
        assert not [each for each in names if f"`{each}`" not in page], name


def test_the_help_of_a_command_says_no_option_that_its_page_leaves_out(pages: dict[str, Page]):
    """Counted independently: what ``--help`` prints, against the page."""
    said = set(re.findall(r"--[a-z][\w-]+", truetip("calibrate", "--help").stdout))
    assert (
        said - {f[1:-1] for f in re.findall(r"`--[\w-]+`", pages["reference/commands/calibrate.md"].text)}
        == set()
    )


@pytest.mark.parametrize("name", shipped_scenarios())
def test_every_key_of_a_shipped_scenario_is_a_field_of_the_reference(name: str, pages: dict[str, Page]):
    """What a file may say is read from its schema; what the files say must be among it."""
    page = pages["reference/scenario-fields.md"].text
    listed = {TAG.sub("", path) for path in re.findall(r"^\| `([^`]+)`", page, re.MULTILINE)}
    groups = {path.rpartition(".")[0] for path in listed}
    maps = {path for path in listed if re.search(rf"`{re.escape(path)}` \|[^|]*\| group\b", page)}
    stated = stated_keys(read_scenario_nodes(name, [], Scenario)) - {""}
    wrong = {
        key
        for key in stated
        if key not in listed | groups and not key.endswith(".kind") and key.rpartition(".")[0] not in maps
    }
    assert not {key for key in wrong if not any(group.startswith(f"{key}.") for group in groups)}


def test_fields_have_default_range_unit_and_meaning(pages: dict[str, Page]):
    page = pages["reference/scenario-fields.md"].text
    row = next(line for line in page.splitlines() if line.startswith("| `station.period`"))
    assert row == (
        "| `station.period` | `0.004` | between 0.0005 and 0.1 s | between two commands and between two "
        "joint samples |"
    )
    robot = pages["reference/robot-fields.md"].text
    assert "`joints[].drive_train.friction(!StickSlip).breakaway`" in robot
    assert "`links[].beam.length`" in robot


@pytest.mark.parametrize("name", ["misaligned", "everything"])
def test_a_scenario_that_is_shown_is_read_back_as_it_is(name: str, tmp_path: Path):
    shown = truetip("scenarios", "--show", name)
    (tmp_path / "shown.yaml").write_text(shown.stdout)
    assert scenario_text(load_scenario(str(tmp_path / "shown.yaml"))) == scenario_text(load_scenario(name))


@pytest.mark.slow
def test_shipped_scenarios_and_robots_are_listed(pages: dict[str, Page]):
    page = pages["reference/shipped.md"].text
    assert not [name for name in shipped_scenarios() if f"`{name}`" not in page]
    assert not [name for name in shipped_robots() if f"`{name}` | {load_robot(name).name}" not in page]


def test_the_meaning_of_a_field_is_its_comment_beside_or_above():
    @dataclass
    class Part:
        mass: float = 1.0  # kg
        # m, from the flange
        length: float = 1.0  # of the tool
        names: list[str] = field(default_factory=list)  # in this order
        plain: bool = False

    assert meanings(Part) == {
        "mass": "kg",
        "length": "m, from the flange of the tool",
        "names": "in this order",
    }


def test_chapters_of_the_readme_are_pages_whose_links_lead_where_they_did():
    text = "# Title\nopening\n## One more\nsee [x](docs/a.svg), `docs/own_law.md`\n## Two\nend\n"
    found = chapters(text)
    assert list(found) == ["opening", "one-more", "two"]
    title, page = found["one-more"]
    assert (title, page) == ("One more", "# One more\n\nsee [x](../a.svg), [own_law.md](../own_law.md)\n")


def test_generated_pages_stand_where_the_contents_name_them():
    pages = {"reference/commands/run.md": Page("truetip run", "")}
    contents = ["index.md", {"Reference": [COMMANDS, "files.md"]}]
    assert with_generated(contents, pages) == [
        "index.md",
        {"Reference": [{"truetip run": "reference/commands/run.md"}, "files.md"]},
    ]

"""The laws of the repository itself: floors, package data, size of files, first words to a newcomer."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from fnmatch import fnmatch
from importlib.resources import files
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
FLOORS = ["robots", "systems", "diagrams", "experiments"]  # from the ground up
DATA = {"robots": "data", "diagrams": "scenario/data", "experiments": "report/assets"}

SOURCES = sorted(path for floor in FLOORS for path in (ROOT / floor).rglob("*.py"))
TESTS = sorted((ROOT / "tests").rglob("*.py"))
DATA_FILES = sorted(
    path
    for floor in FLOORS
    for path in (ROOT / floor).rglob("*.*")
    if path.suffix in {".yaml", ".yml", ".html", ".css", ".js", ".typed"}
)
FOLDERS = sorted({path.parent for path in [*SOURCES, *TESTS, *DATA_FILES]})
ROOT_FILES = [path for path in ROOT.iterdir() if path.suffix in {".md", ".toml"} or path.name == "Makefile"]

# Imports the modules of others once and then each of ours in a process of its own, forked from this one.
IMPORT_ALONE = """
import contextlib, gc, importlib, os, sys
foreign, ours = sys.argv[1].split(), sys.argv[2].split()
for module in foreign:
    with contextlib.suppress(ImportError):  # a name within a module
        importlib.import_module(module)
assert not set(ours) & set(sys.modules)
gc.disable()  # a search for garbage would copy the pages that a child shares with this process
for module in ours:
    child = os.fork()
    if child == 0:
        try:
            importlib.import_module(module)
        except BaseException as error:
            print(f"{module}: {type(error).__name__}: {error}", flush=True)
        os._exit(0)
    os.waitpid(child, 0)
"""


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def imports(path: Path) -> set[str]:
    """The modules that a file imports, wherever in the file; relative ones begin with a dot."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            module = "." * node.level + (node.module or "")
            found |= {module} | {f"{module}.{alias.name}" for alias in node.names}
    return found


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_a_floor_imports_only_from_floors_below(path: Path):
    floor = FLOORS.index(path.relative_to(ROOT).parts[0])
    forbidden = {*FLOORS[floor + 1 :], "tests", ""}  # "" stands for a relative import
    assert not [module for module in imports(path) if module.split(".")[0] in forbidden]


@pytest.mark.parametrize("path", [p for p in SOURCES if p.is_relative_to(ROOT / "robots")], ids=name)
def test_a_robot_knows_no_time_no_ports_and_no_sockets(path: Path):
    forbidden = ("time", "datetime", "socket", "asyncio", "pydrake.systems")
    allowed = {"pydrake.systems.framework", "pydrake.systems.framework.Context"}  # the state of a plant
    modules = imports(path) - allowed
    assert not [m for m in modules if any(m == f or m.startswith(f"{f}.") for f in forbidden)]


@pytest.mark.parametrize("path", [*SOURCES, *TESTS], ids=name)
def test_a_file_is_short_enough_to_be_read_in_one_sitting(path: Path):
    assert len(path.read_text().splitlines()) <= 400


@pytest.mark.parametrize("folder", FOLDERS, ids=name)
def test_a_folder_is_small_enough_to_be_one_room(folder: Path):
    assert len([path for path in folder.iterdir() if path.is_file() and path.name != "__init__.py"]) <= 15


def test_the_rooms_import_as_the_contracts_in_pyproject_say():
    """Floors, the walls between rooms and the order of rooms on a floor; without circles anywhere."""
    linter = Path(sys.executable).with_name("lint-imports")
    result = subprocess.run([linter, "--no-cache"], cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs processes that fork")
def test_every_module_can_be_imported_alone_in_a_fresh_process():
    """In whichever order a program imports, no module waits for one that waits for it."""
    modules = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in SOURCES]
    foreign = {module for path in SOURCES for module in imports(path) if module.split(".")[0] not in FLOORS}
    result = subprocess.run(
        [sys.executable, "-c", IMPORT_ALONE, " ".join(sorted(foreign)), " ".join(modules)],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert (result.returncode, result.stdout) == (0, ""), result.stdout + result.stderr


@pytest.mark.parametrize("path", [*SOURCES, *TESTS, *DATA_FILES, *ROOT_FILES], ids=name)
def test_no_file_names_a_folder_of_one_machine(path: Path):
    machine = re.compile(r"(?<![\w.~])(/(home|Users|root|tmp|work|mnt)/\w|[A-Z]:\\\w)")
    assert not [line for line in path.read_text().splitlines() if machine.search(line)]


@pytest.mark.parametrize("path", DATA_FILES, ids=name)
def test_every_robot_and_scenario_is_found_as_package_data(path: Path):
    floor, *rest = path.relative_to(ROOT).parts
    patterns = PROJECT["tool"]["setuptools"]["package-data"].get(floor, [])
    assert any(fnmatch("/".join(rest), pattern) for pattern in patterns)
    assert files(floor).joinpath(*rest).read_text() == path.read_text()


@pytest.mark.parametrize(("floor", "folder"), DATA.items(), ids=str)
def test_robots_and_scenarios_are_shipped(floor: str, folder: str):
    assert [path for path in DATA_FILES if path.parent == ROOT / floor / folder]


def test_every_folder_of_sources_is_a_package():
    """A folder without ``__init__.py`` works in the checkout and is missing after an installation."""
    assert not [name(p.parent) for p in SOURCES if not (p.parent / "__init__.py").exists()]


@pytest.mark.slow
def test_the_wheel_holds_every_source_and_data_file(tmp_path: Path):
    checkout = tmp_path / "checkout"
    for floor in FLOORS:
        shutil.copytree(ROOT / floor, checkout / floor)
    for path in [*ROOT_FILES, ROOT / "LICENSE"]:
        shutil.copy(path, checkout)
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "-w", str(tmp_path), str(checkout)]
    subprocess.run(command, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("truetip-*.whl")
    members = {m for m in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in m}
    assert members == {name(path) for path in [*SOURCES, *DATA_FILES]}
    # What is installed works from any directory, here beside the packages that this environment has.
    installed, elsewhere = tmp_path / "installed", tmp_path / "elsewhere"
    zipfile.ZipFile(wheel).extractall(installed)
    elsewhere.mkdir()
    code = "import experiments.main as m, sys; print(m.__file__); sys.argv[1:] = ['scenarios']; m.main()"
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    command = [sys.executable, "-c", code]
    run = subprocess.run(command, cwd=elsewhere, env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith(str(installed))
    assert "misaligned" in run.stdout
    assert not list(elsewhere.iterdir())


def test_the_changelog_has_an_entry_for_this_version():
    version = re.escape(PROJECT["project"]["version"])
    assert re.search(rf"^## \[{version}\]", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)


def test_the_readme_begins_with_the_two_commands():
    blocks = re.findall(r"^```(?:sh|bash|console)?\n(.*?)^```", (ROOT / "README.md").read_text(), re.M | re.S)
    commands = [line.removeprefix("$ ").split("#")[0].strip() for line in "".join(blocks).splitlines()]
    assert [command for command in commands if command][:2] == ["make demo", "make test"]

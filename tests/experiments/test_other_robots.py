"""Every command on a UR10 from its URDF and on a Puma 560, without a further word; what takes long on one."""

import json
from pathlib import Path

import pytest

from experiments.cli.prepare import prepare
from tests.experiments.commands import RESULTS, truetip
from tests.robots.urdfs import published

ROBOTS = {"ur10": "ur10_robot.urdf", "puma560": "puma560"}


@pytest.fixture(params=ROBOTS)
def robot(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    name = ROBOTS[request.param]
    return str(published(name)) if name.endswith(".urdf") else name


@pytest.mark.slow
def test_a_scenario_is_carried_over_unless_it_says_otherwise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    robot = str(published("ur10_robot.urdf"))
    named = prepare("misaligned", robot=robot)
    Path("mine.yaml").write_text(f"extends: misaligned\nrobot: {robot}\n")
    written = prepare("mine.yaml")
    assert repr(named.scenario.reference) == repr(written.scenario.reference)
    assert written.scenario.station.payload == 7.0  # what a file says for its own robot stays
    own = prepare("misaligned", ["reference.path=circle", "station.payload=1"], robot=robot)
    assert own.scenario.station.payload == 1.0
    assert own.scenario.reference.path.kind == "circle"
    assert "carried over from ABB IRB 1200" in named.note
    assert "path 0.87 times as large" in named.note
    assert "path" not in own.note
    assert "payload" not in own.note
    free = prepare("misaligned", robot=robot, needs_path=False)
    assert free.scenario.reference.path.kind == "rectangle"


@pytest.mark.slow
def test_a_robot_among_the_settings_is_as_one_beside_them():
    """The largest payload of a Puma 560 is a third of the 7 kg that the scenario says for its own robot."""
    beside, among = prepare("misaligned", robot="puma560"), prepare("misaligned", ["robot=puma560"])
    assert among.note == beside.note
    assert among.scenario.station.payload == beside.scenario.station.payload == 2.5
    own = prepare("misaligned", ["robot=puma560", "station.payload=1"])
    assert own.scenario.station.payload == 1.0


@pytest.mark.slow
def test_the_diagram_is_drawn(robot: str):
    assert truetip("diagram", "--robot", robot).exit_code == 0
    assert Path("diagram.svg").is_file()


@pytest.mark.slow
def test_laws_are_compared(robot: str):
    result = truetip("compare", "--quick", "--robot", robot, "--jobs=1")
    assert result.exit_code == 0, result.output
    assert set(RESULTS) <= {path.name for path in Path("out").iterdir()}
    laws = json.loads(Path("out/summary.json").read_text())["runs"]
    assert "carried over" in result.stdout
    for run in laws.values():
        counts = dict(run["guard"])
        # Feedback sets in at once; a slow robot may need a tick more for it than its acceleration allows.
        assert counts.pop("acceleration_limit") <= 2
        assert not any(counts.values())
    assert {"open_loop", "numerical_ik", "pbvs", "position_level"} <= set(laws)


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        ("cell", "--duration=0.1", "--set=station.link.camera.server.port=0"),
        ("health", "--set=station.elasticity=rigid"),
        ("watch", "--study", "--places=1", "--minutes=0", "--set=station.overview.width=320"),
    ],
    ids=lambda command: command[0],
)
def test_what_was_carried_over_is_said_where_nothing_of_a_run_is_shown(robot: str, command: tuple[str, ...]):
    result = truetip(*command, "--robot", robot)
    assert result.exit_code == 0, result.output
    assert " ".join(result.stdout.split()).count("Note: carried over from ABB IRB 1200") == 1


@pytest.mark.slow
def test_modes_are_found(robot: str):
    result = truetip("modes", "--robot", robot, "--grid=3", "--json", "-")
    assert result.exit_code == 0, result.output
    frequency = json.loads(result.stdout)["stretched"]["frequency_hz"]
    assert 3.0 < frequency[0] < 30.0  # Hz, where robots of this size have it


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["puma560"], indirect=True)
def test_feedforwards_are_compared(robot: str):
    """The plant is that of the models, so the model with an elastic structure leaves hardly anything."""
    result = truetip("feedforward", "--robot", robot, "--grid=2", "--json", "-", "--jobs=1")
    assert result.exit_code == 0, result.output
    relative = json.loads(result.stdout)["path"]["max"]
    assert relative["elastic_structure"] < 0.1 * relative["flexible_joint"] < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["ur10"], indirect=True)
def test_the_simulated_robot_is_calibrated(robot: str):
    result = truetip("calibrate", "--robot", robot, "--count=30", "--write=found.yaml", "--json=numbers.json")
    assert result.exit_code == 0, result.output
    numbers = json.loads(Path("numbers.json").read_text())
    assert numbers["converged"]
    assert numbers["rank"] == 30


@pytest.mark.slow
def test_measurements_are_designed(robot: str):
    result = truetip("design", "--robot", robot, "--count=30", "--write=where.csv", "--json=numbers.json")
    assert result.exit_code == 0, result.output
    numbers = json.loads(Path("numbers.json").read_text())
    assert 0.99 * numbers["bound"] <= numbers["value"] <= numbers["bound"]
    assert len(Path("where.csv").read_text().splitlines()) == 31

"""``truetip robots``: the list, a robot file of a URDF, and what is refused."""

from pathlib import Path

import pytest

from robots.description.model import load_robot
from tests.experiments.commands import files, refusal, truetip
from tests.robots.urdfs import arm, joint, link, published

MESHES = {"shapes/hand.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "shapes/hand.dae": "<COLLADA/>"}


@pytest.fixture(autouse=True)
def _wide_terminal_in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")


def test_without_more_the_shipped_robots_are_listed():
    result = truetip("robots")
    assert result.exit_code == 0
    assert "Universal Robots UR10" in result.stdout


def test_a_urdf_becomes_a_robot_file_and_the_assumptions_are_said(tmp_path: Path):
    result = truetip("robots", "import", published("ur10_robot.urdf"), "--write=my.yaml")
    assert result.exit_code == 0, result.output
    assert "gears, motors and friction" in result.stdout
    assert "wrist_3_joint" in result.stdout
    assert load_robot("my.yaml").name == "ur10"


def test_a_urdf_without_inertia_needs_the_mass_of_the_robot_alone():
    """ROS-Industrial has most robots so; the refusal says what to do."""
    Path("arm.urdf").write_text(arm(bare=range(7)))
    assert "truetip robots import --mass KG" in refusal(truetip("robots", "import", "arm.urdf"))
    result = truetip("robots", "import", "arm.urdf", "--mass=52", "--payload=7", "--write=my.yaml")
    assert result.exit_code == 0, result.output
    assert "masses of 7 links" in result.stdout
    assert load_robot("my.yaml").payload.largest_mass == 7.0


def test_limits_that_look_like_degrees_are_named():
    Path("arm.urdf").write_text(arm().replace('lower="-2" upper="2.5"', 'lower="-170" upper="170"', 2))
    result = truetip("robots", "import", "arm.urdf")
    assert "1800 degrees and more to a side: j1, j2; limits of a URDF are in radians" in " ".join(
        result.output.split()
    )


def test_held_joints_and_lost_meshes_are_named():
    mesh = '<visual><geometry><mesh filename="package://lost/tool.obj"/></geometry></visual>'
    finger = link("finger", shape=mesh) + joint("slide", "l6", "finger", "prismatic")
    Path("arm.urdf").write_text(arm(more=finger))
    result = truetip("robots", "import", "arm.urdf")
    assert "taken as fixed at zero: slide" in result.stdout
    assert "1 meshes were not found, for example package://lost/tool.obj" in result.stdout


def test_a_folder_with_urdf_meshes_and_robot_file_can_be_moved(tmp_path: Path):
    shapes = {name: f'<visual><geometry><mesh filename="{name}"/></geometry></visual>' for name in MESHES}
    more = "".join(link(f"hand{k}", shape=shapes[name]) for k, name in enumerate(MESHES))
    more += "".join(joint(f"mount{k}", "l6", f"hand{k}", "fixed") for k in range(len(MESHES)))
    Path("arm/shapes").mkdir(parents=True)
    for name, text in MESHES.items():
        Path("arm", name).write_text(text)
    Path("arm/arm.urdf").write_text(arm(more=more))
    result = truetip("robots", "import", "arm/arm.urdf", "--write=arm/arm.yaml", "--tip-link=l6")
    assert result.exit_code == 0, result.output
    assert "1 meshes are left out, for example: " in result.stdout
    Path("arm").rename("moved")
    (picture,) = load_robot("moved/arm.yaml").links[5].pictures
    assert picture.file == str(tmp_path / "moved/shapes/hand.obj")


REFUSED = {
    "no file": (["nope.urdf"], "nope.urdf"),
    "seven axes": (["seven.urdf"], "needs six revolute joints in a row, got 7"),
    "no URDF": (["seven.yaml"], "is no URDF: its name must end in .urdf or .xacro"),
    "no link": (["seven.urdf", "--tip-link=hand"], "--tip-link must be one of l0, l1"),
    "no folder": (["seven.urdf", "--package=mine=nowhere"], "--package must be NAME=DIR"),
    "no YAML": (["seven.urdf", "--base-link=l1", "--write=my.txt"], "its name must end in .yaml or .yml"),
}


@pytest.mark.parametrize(("arguments", "reason"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_imported_is_refused_in_one_line(arguments, reason, tmp_path: Path):
    Path("seven.urdf").write_text(arm(7))
    assert reason in refusal(truetip("robots", "import", *arguments))
    assert files(tmp_path) == {"seven.urdf"}

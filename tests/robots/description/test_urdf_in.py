"""Robots from URDF: the same frames and masses as Drake's and as the text's, and what is refused."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import Role, SceneGraph
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from robots.configuration.nodes import ConfigurationError
from robots.configuration.shortest import shortest
from robots.description.model import RobotFileError, RobotModel, load_robot, robot_of, shipped_robots
from robots.description.robot_file import robot_text
from robots.description.source_notes import foreign_sources_note
from robots.description.urdf import urdf_text
from robots.description.urdf_in.masses import SHARES
from robots.description.urdf_in.reader import read_urdf
from robots.dynamics.plant import add_robot
from robots.kinematics.forward import Kinematics
from tests.robots.urdfs import arm, joint, link, published

CONFIGURATIONS = np.random.default_rng(0).uniform(-2.0, 2.0, (20, 6))


def drakes(path: Path) -> MultibodyPlant:
    """The whole file in a plant, meshes and all."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    if "example-robot-data" in path.parts:
        parser.package_map().Add("example-robot-data", path.parents[3])
    (model,) = parser.AddModels(path)
    if plant.HasBodyNamed("l0", model):
        plant.WeldFrames(plant.world_frame(), plant.GetBodyByName("l0").body_frame())
    plant.Finalize()
    return plant


def rigid(robot: RobotModel) -> MultibodyPlant:
    plant = MultibodyPlant(0.0)
    add_robot(plant, robot, "rigid", drive_trains=False)
    plant.Finalize()
    return plant


def assert_same_robot(robot: RobotModel, path: Path, tip: str):
    """Frames, masses, centres and inertias: poses of the tip, mass matrices and gravity agree."""
    kinematics, drake, ours = Kinematics(robot), drakes(path), rigid(robot)
    context, own = drake.CreateDefaultContext(), ours.CreateDefaultContext()
    for q in CONFIGURATIONS:
        drake.SetPositions(context, q)
        ours.SetPositions(own, q)
        X = drake.GetBodyByName(tip).EvalPoseInWorld(context).GetAsMatrix4()
        np.testing.assert_allclose(kinematics.forward(q), X, atol=1e-12)
        for quantity in ("CalcMassMatrix", "CalcGravityGeneralizedForces"):
            there, here = getattr(drake, quantity)(context), getattr(ours, quantity)(own)
            np.testing.assert_allclose(here, there, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("name", ["ur5_robot", "ur10_robot"])
def test_a_published_robot_is_the_one_that_drake_reads(name: str):
    path = published(f"{name}.urdf")
    assert_same_robot(load_robot(str(path)), path, "tool0")


def test_turned_inertias_with_products_and_bodies_that_are_fixed_are_kept(tmp_path: Path):
    path = tmp_path / "small.urdf"
    path.write_text(arm(more=link("camera") + joint("mount", "l3", "camera", "fixed")))
    robot = load_robot(str(path))
    assert robot.links[2].mass == 4.0
    assert_same_robot(robot, path, "l6")
    written = tmp_path / "again.urdf"
    written.write_text(urdf_text(robot))
    assert_same_robot(load_robot(str(written)), path, "l6")


@pytest.mark.parametrize("name", ["irb1200", "puma560", "kr210"])
def test_what_is_written_is_read_again(name: str, tmp_path: Path):
    robot, path = load_robot(name), tmp_path / "robot.urdf"
    path.write_text(urdf_text(robot))
    read = load_robot(str(path))
    np.testing.assert_allclose(
        Kinematics(read).forward(CONFIGURATIONS), Kinematics(robot).forward(CONFIGURATIONS), atol=1e-12
    )
    for attribute in ("lower", "upper", "speed"):
        np.testing.assert_allclose(getattr(read, attribute), getattr(robot, attribute), rtol=1e-12)


def test_numbers_are_those_that_somebody_would_have_written(tmp_path: Path):
    """Degrees of radians with twelve digits, and sums of bodies in turned frames, leave rounding."""
    (tmp_path / "arm.urdf").write_text(arm().replace('lower="-2"', 'lower="-6.28318530718"'))
    robot = load_robot(str(tmp_path / "arm.urdf"))
    assert [joint.limits.lower_deg for joint in robot.joints] == [-360.0] * 6
    assert [link.center_of_mass.tolist() for link in robot.links] == [[0.01, 0.0, 0.1]] * 6
    assert all(len(repr(float(x))) <= 18 for link in robot.links for x in (*link.inertia, *link.products))
    values = np.random.default_rng(0).normal(size=1000) * 10.0 ** np.arange(-10, 10).repeat(50)
    np.testing.assert_allclose([shortest(value) for value in values], values, rtol=1e-13)


def test_a_robot_file_may_extend_a_urdf_and_hold_one(tmp_path: Path):
    (tmp_path / "arm.urdf").write_text(arm())
    (tmp_path / "mine.yaml").write_text("extends: arm.urdf\npayload: {largest_mass: 3.5}\n")
    robot = load_robot(str(tmp_path / "mine.yaml"))
    assert robot.payload.largest_mass == 3.5
    (tmp_path / "copy.yaml").write_text(robot_text(robot))
    assert robot_text(load_robot(str(tmp_path / "copy.yaml"))) == robot_text(robot)


def test_what_a_urdf_cannot_hold_is_assumed_in_proportion_to_the_inertia(tmp_path: Path):
    light, heavy = tmp_path / "light.urdf", tmp_path / "heavy.urdf"
    light.write_text(arm())
    hundredfold = re.sub(r'(i[xyz]{2})="([-.\d]+)"', lambda m: f'{m[1]}="{100.0 * float(m[2])}"', arm())
    heavy.write_text(hundredfold.replace('mass value="2"', 'mass value="200"'))
    gears = []
    for path in (light, heavy):
        robot = load_robot(str(path))
        trains = [joint.drive_train for joint in robot.joints]
        assert all("assumed" in train.source for train in trains)
        assert "assumed" in robot.payload.source
        gears.append(robot.joint_stiffness / robot.reflected_inertia)
    # The swing against a held motor does not depend on the size.
    np.testing.assert_allclose(gears[1], gears[0], rtol=0.01)
    assert load_robot(str(heavy)).joint_stiffness[0] > 50.0 * load_robot(str(light)).joint_stiffness[0]


def test_a_gripper_is_held_and_an_end_can_be_chosen(tmp_path: Path):
    path = tmp_path / "arm.urdf"
    fingers = [link(name) + joint(f"k_{name}", "l6", name, "prismatic") for name in ("left", "right")]
    path.write_text(arm(more="".join(fingers)))
    found = read_urdf(path, "URDF")
    assert ([j.name for j in found.chain.held], found.chain.tip) == (["k_left", "k_right"], "l6")
    assert load_robot(str(path)).links[5].mass == 6.0
    path.write_text(arm(7))
    chosen = read_urdf(path, "URDF", base="l1")
    assert ([j.name for j in chosen.chain.joints], chosen.chain.tip) == ([f"j{k}" for k in range(2, 8)], "l7")
    assert read_urdf(path, "URDF", tip="l6").chain.tip == "l6"


def test_masses_that_are_missing_come_from_that_of_the_robot(tmp_path: Path):
    """They add up to it, what links say stays, and each is a cylinder from joint to joint, or a ball."""
    path = tmp_path / "arm.urdf"
    path.write_text(arm(bare=[0, 1, 2, 4, 5, 6]))
    found = read_urdf(path, "URDF", mass=40.0, payload=3.0)
    robot = robot_of(found.nodes)
    links = [robot.base_link, *robot.links]
    assert sum(link.mass for link in links) == pytest.approx(40.0)
    assert (robot.links[2].mass, robot.payload.largest_mass) == (2.0, 3.0)
    assert found.assumed == ["gears, motors and friction", "bearings", "masses of 6 links"]
    stretch = robot.joints[4].placement.translation
    slender, length = robot.links[3], np.linalg.norm(stretch)
    np.testing.assert_allclose(slender.center_of_mass, 0.5 * stretch, atol=1e-12)
    tensor = np.diag(slender.inertia)
    tensor[np.triu_indices(3, 1)] = tensor[np.tril_indices(3, -1)] = slender.products
    radius = np.sqrt(2.0 * np.linalg.eigvalsh(tensor)[0] / slender.mass)
    assert slender.mass / (np.pi * radius**2 * length) == pytest.approx(2500.0)
    np.testing.assert_allclose(tensor @ stretch, 0.5 * slender.mass * radius**2 * stretch, rtol=1e-9)
    assert np.ptp(robot.links[5].inertia) < 1e-12  # the flange is at the tool: a ball


def test_masses_that_are_all_the_same_are_a_placeholder(tmp_path: Path):
    path = tmp_path / "arm.urdf"
    path.write_text(arm())
    assert read_urdf(path, "URDF").placeholder == 2.0
    found = read_urdf(path, "URDF", mass=40.0)
    masses = np.array([link.mass for link in robot_of(found.nodes).links])
    np.testing.assert_allclose(masses, 40.0 * np.array(SHARES[1:]))
    assert found.placeholder is None
    assert "masses of 7 links" in found.assumed
    path.write_text(arm().replace('ixx="0.02"', 'ixx="0.021"', 3))
    assert read_urdf(path, "URDF").placeholder is None


def test_an_inertia_that_is_somewhat_too_flat_becomes_that_of_a_flat_body(tmp_path: Path):
    """The second moment of mass across it is zero, the others stay; nothing changes about axes or sources."""
    path = tmp_path / "arm.urdf"
    path.write_text(arm().replace('iyy="0.03"', 'iyy="0.07"', 2))  # of the base and of link 1
    found = read_urdf(path, "URDF")
    robot = robot_of(found.nodes)
    assert list(found.corrected) == ["l0", "l1"]
    tensor = np.diag(robot.links[0].inertia)
    tensor[np.triu_indices(3, 1)] = tensor[np.tril_indices(3, -1)] = robot.links[0].products
    moments = np.linalg.eigvalsh(tensor)
    assert moments[0] + moments[1] == pytest.approx(moments[2])
    assert moments[2] == pytest.approx(0.07, rel=0.01)
    assert "nearest that a body can have" in robot.links[0].source
    assert "nearest" not in robot.links[0].center_of_mass_source + robot.links[1].source


@pytest.mark.parametrize("name", shipped_robots())
def test_robots_whose_links_are_known_have_their_masses_where_those_of_others_are_assumed(name: str):
    robot = load_robot(name)
    if "a share of" in robot.links[0].source:
        pytest.skip("its masses are assumed")
    masses = np.array([robot.base_link.mass, *(link.mass for link in robot.links)])
    factors = masses / masses.sum() / SHARES
    assert (factors[1:4] > 0.5).all()
    assert (factors[1:4] < 1.9).all()
    assert (factors > 1.0 / 3.2).all()
    assert (factors < 3.7).all()


MIMIC = '<mimic joint="j1"/>'
REFUSED = {
    "no inertia": (arm(bare=[3]), r"link 'l3' moves and has no mass or inertia"),
    "a loop": (arm(more=joint("j9", "l2", "l5", "fixed")), r"line \d+: link 'l5' hangs on .*a loop"),
    "a ring": (arm(more=joint("j9", "l6", "l0", "fixed")), "the links form a loop"),
    "seven axes": (arm(7), "needs six revolute joints in a row, got 7: j1, j2"),
    "five axes": (arm(5), "needs six revolute joints in a row, got 5"),
    "a slide": (arm(kinds={3: "prismatic"}), r"line \d+: joint 'j3' is prismatic"),
    "a coupled joint": (
        arm().replace(joint("j4", "l3", "l4"), joint("j4", "l3", "l4", more=MIMIC)),
        r"joint 'j4' mimics 'j1'",
    ),
    "two arms": (arm(3, more=link("b") + joint("k1", "l2", "b")), "the arm divides into 'j3', 'k1'"),
    "macros": (arm().replace('xyz="0 0 1"', 'xyz="${axis}"'), "it still has xacro macros"),
    "no link": (arm().replace('parent link="l3"', 'parent link="x"'), "its parent 'x' is no link"),
    "two roots": (arm(more=link("alone")), "one link must carry all others, got l0, alone"),
    "no XML": (arm()[:200], "no readable URDF"),
    "another format": ("<sdf/>", "a URDF begins with <robot>, got <sdf>"),
    "no range": (arm().replace('lower="-2" upper="2.5"', 'lower="1" upper="1"'), "joint 'j1': has no range"),
    "crossed limits": (arm().replace('lower="-2"', 'lower="3"'), "limit 3 is not below the upper 2.5"),
    "a negative mass": (
        arm(more=link("x").replace('"2"', '"-2"') + joint("k", "l2", "x", "fixed")),
        r"line \d+: link 'x': its mass must be zero or positive, in kg, got -2",
    ),
    "no number": (arm().replace('value="2"', 'value="nan"'), "link 'l0': its mass must be zero or pos.* nan"),
    "no body": (arm().replace('ixx="0.02"', 'ixx="100"'), "link 'l0': its principal .* above the sum"),
    "inertia alone": (
        arm().replace('value="2"', 'value="0"'), r"line \d+: link 'l0': it has an inertia and no mass",
    ),
    "millimetres": (arm().replace("0.02 0.01 0.2", "20 10 200"), "805 m from joint 2 to the tool; .* in mm"),
    "decimal commas": (arm().replace("0.02 0.01 0.2", "0,02 0,01 0,2"), "Drake cannot .*Expected 3 val"),
    "a negative moment": (arm().replace('izz="0.04"', 'izz="-0.04"'), "link 'l0': its principal moments"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "reason"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_such_robot_is_refused_in_one_line(text: str, reason: str, tmp_path: Path):
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    with pytest.raises(RobotFileError, match=reason) as refused:
        load_robot(str(path))
    assert "arm.urdf" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_limit_that_is_left_out_beside_another_is_zero(tmp_path: Path):
    path = tmp_path / "arm.urdf"
    path.write_text(arm().replace('lower="-2" ', ""))
    limits = load_robot(str(path)).joints[0].limits
    assert (limits.lower_deg, limits.upper_deg) == pytest.approx((0.0, np.rad2deg(2.5)))


@pytest.mark.parametrize(
    ("bare", "mass", "reason"),
    [
        ([3], 12.0, "12 kg; its links that say their masses have 12 kg already"),
        ([], 40.0, "here all have one"),
    ],
)
def test_a_mass_that_leaves_nothing_to_assume_is_refused(
    bare: list[int], mass: float, reason: str, tmp_path: Path
):
    path = tmp_path / "arm.urdf"
    path.write_text(arm(bare=bare).replace('ixx="0.02"', 'ixx="0.021"', 3))
    with pytest.raises(ConfigurationError, match=reason):
        read_urdf(path, "URDF", mass=mass)


def test_a_viewer_shows_its_meshes_or_capsules_where_they_are_missing(tmp_path: Path):
    path = published("ur10_robot.urdf")
    elsewhere = tmp_path / "ur10.urdf"
    elsewhere.write_text(path.read_text())
    lost, there = read_urdf(elsewhere, "URDF"), load_robot(str(path))
    assert len(lost.missing_meshes) > 7
    found = read_urdf(elsewhere, "URDF", packages={"example-robot-data": path.parents[3]})
    assert not found.missing_meshes
    names = {
        kind: shown(robot) for kind, robot in (("meshes", there), ("capsules", load_robot(str(elsewhere))))
    }
    assert sum("picture" in name for name in names["meshes"]) >= 7
    assert sum("capsule" in name for name in names["capsules"]) >= 5


def test_stl_is_shown_too():
    robot = load_robot(str(published("ur10_robot.urdf")))
    for each in [robot.base_link, *robot.links]:
        for picture in each.pictures:
            if picture.shape == "mesh":
                picture.file = picture.file.replace("visual", "collision").replace(".dae", ".stl")
    assert sum("picture" in name for name in shown(robot)) >= 7


def shown(robot: RobotModel) -> list[str]:
    builder = DiagramBuilder()
    plant, scene = builder.AddSystem(MultibodyPlant(0.0)), builder.AddSystem(SceneGraph())
    plant.RegisterAsSourceForSceneGraph(scene)
    add_robot(plant, robot, "rigid")
    plant.Finalize()
    inspector = scene.model_inspector()
    return [inspector.GetName(i) for i in inspector.GetAllGeometryIds(Role.kIllustration)]


def test_a_copied_robot_file_is_told_by_its_sources():
    robot = load_robot("ur10")
    assert foreign_sources_note(robot) == ""
    note = foreign_sources_note(replace(robot, name="my arm"))
    assert "sources in the file of my arm are those of another robot" in note
    assert "of Universal Robots UR10" in note
    assert all(foreign_sources_note(load_robot(name)) == "" for name in ("irb1200", "kr16-realistic"))
    assert foreign_sources_note(replace(robot, name=f"{robot.name}, calibrated")) == ""
    assert foreign_sources_note(load_robot(str(published("ur10_robot.urdf")))) == ""

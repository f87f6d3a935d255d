"""Meshes of robot files: where they are looked for, that both viewers see the same, what is refused."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydrake.geometry import Mesh
from pydrake.multibody.plant import MultibodyPlant

from robots.description.model import RobotFileError, RobotModel, load_robot
from robots.description.pictures.mesh_file import read_mesh
from robots.description.pictures.picture import Picture
from robots.description.robot_file import robot_text
from robots.description.urdf_in.reader import read_urdf
from robots.dynamics.link_pictures import drakes_mesh
from robots.dynamics.plant import add_robot
from tests.robots.urdfs import arm, joint, link, published

# A wedge without any symmetry, so that nothing can be turned or mirrored unseen.
WEDGE = "v 0 0 0\nv 0.1 0 0\nv 0 0.2 0\nv 0 0 0.3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
POINTS = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]])
MINE = """extends: irb1200
links:
- {}
- {}
- pictures:
  - file: %s
    size: %s
- {}
- {}
- {}
"""


def robot_file(folder: Path, file: str, size: object = "[1, 1, 1]") -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "mine.yaml").write_text(MINE % (file, size))
    return folder / "mine.yaml"


def the_mesh(robot: RobotModel) -> Picture:
    (picture,) = (each for link in [robot.base_link, *robot.links] for each in link.pictures)
    return picture


def same_points(found: np.ndarray, expected: np.ndarray) -> bool:
    """Whether the points are the same in any order, to the digits of a single float."""
    return {tuple(row) for row in np.round(found, 6) + 0.0} == {tuple(row) for row in np.round(expected, 6)}


def test_a_mesh_is_named_from_where_its_file_is_whoever_extends_it(tmp_path: Path, monkeypatch):
    first = robot_file(tmp_path / "arms", "shapes/wedge.obj")
    (tmp_path / "arms/shapes").mkdir()
    (tmp_path / "arms/shapes/wedge.obj").write_text(WEDGE)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/cell.yaml").write_text("extends: ../arms/mine.yaml\nname: mine\n")
    monkeypatch.chdir(tmp_path / "mine")
    for name in (str(first), "cell.yaml"):
        picture = the_mesh(load_robot(name))
        assert Path(picture.file) == tmp_path / "arms/shapes/wedge.obj"
        assert same_points(picture.triangles()[0], POINTS)


def test_a_written_robot_finds_its_meshes_and_moves_with_those_beside_it(tmp_path: Path):
    path = robot_file(tmp_path / "arms", "wedge.obj")
    (tmp_path / "arms/wedge.obj").write_text(WEDGE)
    robot = load_robot(str(path))
    (tmp_path / "elsewhere.yaml").write_text(robot_text(robot))
    assert the_mesh(load_robot(str(tmp_path / "elsewhere.yaml"))).file == str(tmp_path / "arms/wedge.obj")
    path.write_text(robot_text(robot, beside=path))
    (tmp_path / "arms").rename(tmp_path / "moved")
    assert the_mesh(load_robot(str(tmp_path / "moved/mine.yaml"))).file == str(tmp_path / "moved/wedge.obj")


@pytest.mark.parametrize("suffix", [".obj", ".stl", ".gltf", ".glb"])
def test_every_format_is_the_same_shape_for_the_replay_and_for_drake(tmp_path: Path, suffix: str):
    """The y of glTF points upwards: it is the z of the link, as Drake has it."""
    file = tmp_path / f"wedge{suffix}"
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    standing = np.stack([POINTS[:, 0], POINTS[:, 2], -POINTS[:, 1]], -1) if "gl" in suffix else POINTS
    written = trimesh.Trimesh(standing, faces).export(file_type=suffix[1:])
    if isinstance(written, dict):  # of glTF: the file and its buffers
        for name, content in written.items():
            (file if name.endswith(".gltf") else tmp_path / name).write_bytes(content)
    else:
        file.write_bytes(written if isinstance(written, bytes) else written.encode())
    picture = Picture("mesh", str(file), [2.0, 1.0, -1.0])
    expected = POINTS * picture.size
    points, corners = picture.triangles()
    assert same_points(points, expected)
    # The mirrored solid still has its outside outside.
    a, b, c = (points[corners[:, k]] for k in range(3))
    assert np.einsum("ni,ni->", a, np.cross(b, c)) / 6.0 == pytest.approx(2.0 * 1e-3, rel=1e-5)
    hull = drakes_mesh(picture).GetConvexHull()
    assert same_points(np.array([hull.vertex(k) for k in range(hull.num_vertices())]), expected)
    if suffix == ".gltf":
        hull = Mesh(file, np.array(picture.size)).GetConvexHull()
        assert same_points(np.array([hull.vertex(k) for k in range(hull.num_vertices())]), expected)


def test_a_mesh_changes_nothing_that_moves(tmp_path: Path):
    (tmp_path / "wedge.obj").write_text(WEDGE)
    found = []
    for robot in (load_robot("irb1200"), load_robot(str(robot_file(tmp_path, "wedge.obj")))):
        plant = MultibodyPlant(0.0)
        add_robot(plant, robot, "rigid")
        plant.Finalize()
        context = plant.CreateDefaultContext()
        plant.SetPositions(context, np.linspace(-1.0, 1.0, 6))
        found.append((plant.CalcMassMatrix(context), plant.CalcGravityGeneralizedForces(context)))
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


REFUSED = {
    "no file": ("gone.stl", None, r"no mesh .*gone\.stl: no such file"),
    "a folder": (".", None, "a mesh must end in .obj, .stl"),
    "another format": ("arm.dae", b"<COLLADA/>", r"a mesh must end in .*, got .*arm\.dae"),
    "no STL": ("arm.stl", b"nonsense" * 40, r"arm\.stl holds no triangles"),
    "half an STL": ("arm.stl", bytes(80) + b"\x04\0\0\0" + bytes(20), r"arm\.stl holds no"),
    "an empty OBJ": ("arm.obj", b"", r"arm\.obj holds no"),
    "no such corner": ("arm.obj", WEDGE.encode() + b"f 1 2 9\n", r"arm\.obj holds no mesh that can be read"),
    "no number": ("arm.obj", b"v 0 0 x\n" + WEDGE.encode(), r"arm\.obj holds no mesh that can be read"),
    "no GLB": ("arm.glb", b"nonsense" * 40, r"arm\.glb holds no mesh that can be read"),
    "no glTF": ("arm.gltf", b'{"asset": {}}', r"arm\.gltf holds no"),
}  # fmt: skip


@pytest.mark.parametrize(("name", "content", "reason"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_mesh_is_refused_in_one_line_with_its_place(name, content, reason, tmp_path: Path):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(RobotFileError, match=rf"mine\.yaml, line 6: link 3: .*{reason}") as refused:
        load_robot(str(robot_file(tmp_path, name)))
    assert "\n" not in str(refused.value)


SIZES = {
    "[1, 1]": "the size of a mesh needs 3 numbers",
    "[1, 0, 1]": "no factor of a mesh may be zero",
    "[1000, 1000, 1000]": r"is 300 m wide; of one in mm the size is \[0\.001",
}


@pytest.mark.parametrize(("size", "reason"), SIZES.items(), ids=SIZES)
def test_an_impossible_size_is_refused(size: str, reason: str, tmp_path: Path):
    (tmp_path / "wedge.obj").write_text(WEDGE)
    with pytest.raises(RobotFileError, match=rf"line 6: link 3: .*{reason}"):
        load_robot(str(robot_file(tmp_path, "wedge.obj", size)))


def test_a_mesh_that_has_changed_is_read_again(tmp_path: Path):
    file = tmp_path / "wedge.obj"
    for height in ("0.3", "0.45"):
        file.write_text(WEDGE.replace("0.3", height))
        assert read_mesh(file)[0].max() == float(height)


def test_a_urdf_gives_its_meshes_and_says_which_it_leaves_out(tmp_path: Path):
    mesh = '<geometry><mesh filename="{}" scale="2 2 2"/></geometry>'
    shape = f'<visual><origin xyz="0 0 0.05"/>{mesh}</visual>'
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/wedge.obj").write_text(WEDGE)
    (tmp_path / "meshes/hand.stl").write_bytes(b"nonsense" * 40)
    more = link("hand", shape=shape.format("meshes/hand.stl")) + joint("mount", "l6", "hand", "fixed")
    path = tmp_path / "arm.urdf"
    path.write_text(arm(more=more).replace("</link>", shape.format("meshes/wedge.obj") + "</link>", 1))
    picture = the_mesh(load_robot(str(path)))
    assert (picture.file, picture.size) == (str(tmp_path / "meshes/wedge.obj"), [2.0, 2.0, 2.0])
    assert picture.placement.translation.tolist() == [0.0, 0.0, 0.05]
    found = read_urdf(path, "URDF")
    assert not found.missing_meshes
    (reason,) = found.unreadable_meshes
    assert "hand.stl holds no triangles" in reason


def test_shapes_for_collision_stand_in_for_meshes_that_cannot_be_read():
    """The visual shapes of this robot are COLLADA."""
    robot = load_robot(str(published("ur10_robot.urdf")))
    files = [Path(p.file) for each in [robot.base_link, *robot.links] for p in each.pictures if p.file]
    assert len(files) >= 6
    assert {file.suffix for file in files} == {".stl"}

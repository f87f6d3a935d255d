"""The robot of the replay stands where the kinematics says, and its meshes fit into a page."""

import numpy as np
import pytest
import trimesh
from pydrake.multibody.plant import MultibodyPlant
from scipy.spatial.transform import Rotation

from experiments.replay.robot_shapes import MOST_FACES, robot_shapes
from robots.description.model import NUM_JOINTS, RobotModel, load_robot
from robots.description.pictures.picture import Picture
from robots.description.placement import Placement
from robots.dynamics.plant import add_robot
from robots.kinematics.forward import Kinematics
from tests.experiments.report.test_curves import decoded


def placed(body: int, angles: np.ndarray, robot: RobotModel) -> np.ndarray:
    """Where Drake has a link of a robot, (4, 4)."""
    plant = MultibodyPlant(0.0)
    add_robot(plant, robot, "rigid", drive_trains=False)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, angles)
    return plant.GetBodyByName(f"link_{body}").EvalPoseInWorld(context).GetAsMatrix4()


def chained(shapes: dict, angles: np.ndarray) -> np.ndarray:
    """The frame of the link behind as many joints as there are angles, as the page has it, (4, 4)."""
    X = np.reshape(shapes["base"], (4, 4))
    for joint, angle in zip(shapes["joints"], angles, strict=False):
        turn = np.eye(4)
        turn[:3, :3] = Rotation.from_rotvec(angle * np.array(joint["axis"])).as_matrix()
        X = X @ np.reshape(joint["placement"], (4, 4)) @ turn
    return X


def points_and_faces(mesh: dict) -> tuple[np.ndarray, np.ndarray]:
    points = np.stack([decoded(axis) for axis in mesh["points"]], -1)
    return points, decoded(mesh["faces"]).astype(int).reshape(-1, 3)


@pytest.mark.parametrize("name", ["irb1200", "kr210", "ur10"])
def test_the_frames_chained_as_the_page_does_are_the_forward_kinematics(name: str):
    robot = load_robot(name)
    shapes = robot_shapes(robot)
    for q in np.random.default_rng(0).uniform(-2.0, 2.0, (5, 6)):
        X = chained(shapes, q) @ np.reshape(shapes["tool"], (4, 4))
        assert pytest.approx(Kinematics(robot).forward(q[None])[0], abs=1e-5) == X


def test_every_body_of_a_robot_without_pictures_has_a_shape_but_the_flange_alone():
    bodies = robot_shapes(load_robot("irb1200"))["bodies"]
    assert len(bodies) == 7
    assert all(shape["part"] == "base" for shape in bodies[0])
    assert [shape["part"] for shape in bodies[6]] == ["flange"]


def test_a_fine_mesh_becomes_coarse_and_keeps_its_size(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=6, radius=0.2)  # 81,920 faces
    ball.export(tmp_path / "ball.stl")
    robot = load_robot("irb1200")
    place = Placement(translation=np.array([0.0, 0.1, 0.0]))
    robot.links[1].pictures = [Picture("mesh", str(tmp_path / "ball.stl"), [1.0, 1.0, 2.0], place)]
    shapes = robot_shapes(robot)
    (mesh,) = shapes["meshes"]
    assert shapes["bodies"][2] == [
        {
            "kind": "mesh",
            "part": "link",
            "mesh": 0,
            "frame": [1, 0, 0, 0, 0, 1, 0, 0.1, 0, 0, 1, 0, 0, 0, 0, 1],
        }
    ]
    points, faces = points_and_faces(mesh)
    assert 1000 < len(faces) <= MOST_FACES
    assert faces.max() < len(points)
    assert np.ptp(points, axis=0) == pytest.approx([0.4, 0.4, 0.8], abs=0.015)


def test_a_mesh_whose_file_is_gone_leaves_a_capsule(tmp_path):
    robot = load_robot("irb1200")
    robot.links[1].pictures = [Picture("mesh", str(tmp_path / "gone.stl"), [1.0, 1.0, 1.0])]
    assert [shape["kind"] for shape in robot_shapes(robot)["bodies"][2]] == ["capsule"]


def test_a_small_mesh_is_on_the_page_where_its_link_is(tmp_path):
    """Points have steps of 1/20000 of the largest coordinate, 0.4 m."""
    corners = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.4]])
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    (tmp_path / "wedge.obj").write_text("\n".join([*lines, "f 1 3 2", "f 1 2 4", "f 2 3 4", "f 1 4 3"]))
    robot = load_robot("kr210")
    place = Placement(np.array([0.05, -0.1, 0.2]), np.array([30.0, -20.0, 10.0]))
    for link in robot.links:
        link.pictures = [Picture("mesh", str(tmp_path / "wedge.obj"), placement=place)]
    shapes, q = robot_shapes(robot), np.array([0.4, -0.8, 1.1, 0.6, -0.7, 2.0])
    for number in range(1, NUM_JOINTS + 1):
        shape = shapes["bodies"][number][0]
        points, _ = points_and_faces(shapes["meshes"][shape["mesh"]])
        X = chained(shapes, q[:number]) @ np.reshape(shape["frame"], (4, 4))
        expected = (placed(number, q, robot) @ place.pose().GetAsMatrix4()) @ np.c_[corners, np.ones(4)].T
        for point in (X @ np.c_[points, np.ones(len(points))].T)[:3].T:
            assert np.linalg.norm(expected[:3].T - point, axis=1).min() < 4e-5


def test_many_fine_meshes_share_what_a_page_may_hold(tmp_path):
    trimesh.creation.icosphere(subdivisions=4, radius=0.2).export(tmp_path / "ball.stl")  # 5,120 faces
    robot = load_robot("irb1200")
    for link in robot.links:
        link.pictures = [Picture("mesh", str(tmp_path / "ball.stl"))] * 3
    meshes = robot_shapes(robot)["meshes"]
    assert len(meshes) == 18
    assert 0.3 * MOST_FACES < sum(len(points_and_faces(mesh)[1]) for mesh in meshes) <= MOST_FACES

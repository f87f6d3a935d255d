"""The robot of the replay stands where the kinematics says, and its meshes fit into a page."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from experiments.replay.robot_shapes import MOST_FACES, robot_shapes
from robots.description.model import load_robot
from robots.description.placement import Picture, Placement
from robots.kinematics.forward import Kinematics
from tests.experiments.report.test_curves import decoded


@pytest.mark.parametrize("name", ["irb1200", "kr210", "ur10"])
def test_the_frames_chained_as_the_page_does_are_the_forward_kinematics(name: str):
    robot = load_robot(name)
    shapes = robot_shapes(robot)
    for q in np.random.default_rng(0).uniform(-2.0, 2.0, (5, 6)):
        X = np.reshape(shapes["base"], (4, 4))
        for joint, angle in zip(shapes["joints"], q, strict=True):
            turn = np.eye(4)
            turn[:3, :3] = Rotation.from_rotvec(angle * np.array(joint["axis"])).as_matrix()
            X = X @ np.reshape(joint["placement"], (4, 4)) @ turn
        X = X @ np.reshape(shapes["tool"], (4, 4))
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
    points = np.stack([decoded(axis) for axis in mesh["points"]], -1)
    faces = decoded(mesh["faces"]).astype(int).reshape(-1, 3)
    assert len(faces) <= MOST_FACES
    assert faces.max() < len(points)
    assert np.ptp(points, axis=0) == pytest.approx([0.4, 0.4, 0.8], abs=0.015)


def test_a_mesh_whose_file_is_gone_leaves_a_capsule(tmp_path):
    robot = load_robot("irb1200")
    robot.links[1].pictures = [Picture("mesh", str(tmp_path / "gone.stl"), [1.0, 1.0, 1.0])]
    assert [shape["kind"] for shape in robot_shapes(robot)["bodies"][2]] == ["capsule"]

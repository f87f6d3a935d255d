"""A robot as URDF: what it holds, what it cannot hold and says so, and the sag of one pose baked in."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.geometry import Role, SceneGraph
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from robots.description.model import RobotModel, load_robot
from robots.description.urdf import not_in_urdf, urdf_text
from robots.dynamics.baked_sag import with_baked_sag
from robots.dynamics.compliant_kinematics import CompliantKinematics
from robots.kinematics.forward import Kinematics

ROBOT = load_robot("irb1200")
YIELDING = replace(
    ROBOT, calibration=replace(ROBOT.calibration, compliance=(1.0 / ROBOT.joint_stiffness).tolist())
)
POSE = np.deg2rad([10.0, 40.0, -20.0, 30.0, 50.0, 5.0])


def parsed(robot: RobotModel) -> tuple[MultibodyPlant, SceneGraph]:
    builder = DiagramBuilder()
    plant, scene = builder.AddSystem(MultibodyPlant(0.0)), builder.AddSystem(SceneGraph())
    plant.RegisterAsSourceForSceneGraph(scene)
    Parser(plant).AddModelsFromString(urdf_text(robot), "urdf")
    plant.Finalize()
    return plant, scene


def test_drake_sees_actuators_and_a_viewer_sees_a_robot():
    plant, scene = parsed(ROBOT)
    assert plant.num_actuators() == 6
    names = [plant.get_joint_actuator(i).joint().name() for i in plant.GetJointActuatorIndices()]
    assert names == [f"joint_{number}" for number in range(1, 7)]
    assert scene.model_inspector().NumGeometriesWithRole(role=Role.kIllustration) >= 5
    ratios = [plant.get_joint_actuator(i).default_gear_ratio() for i in plant.GetJointActuatorIndices()]
    np.testing.assert_allclose(ratios, ROBOT.gear_ratio)


def test_what_has_no_place_is_said_in_the_file_and_in_words():
    assert not_in_urdf(ROBOT) == "URDF cannot hold stiffness and friction of the drive trains"
    assert "the counterbalance" in not_in_urdf(load_robot("kr210"))
    assert "compliances of joints 1, 2, 3, 4, 5, 6" in not_in_urdf(YIELDING)
    assert f"<!-- {not_in_urdf(YIELDING)} -->" in urdf_text(YIELDING)
    assert "<!-- Exact at one pose. -->" in urdf_text(YIELDING, "Exact at one pose.")


@pytest.mark.parametrize("payload", [0.0, 7.0])
def test_baked_in_the_sag_is_exact_at_its_pose_and_nearly_so_around_it(payload: float):
    """Rounding there; a tenth of a radian away the load has changed by a tenth."""
    baked = Kinematics(with_baked_sag(YIELDING, payload, POSE))
    true, rigid = CompliantKinematics(YIELDING, payload), Kinematics(YIELDING)
    np.testing.assert_allclose(baked.forward(POSE), true.forward(POSE), atol=1e-12)
    gap = np.linalg.norm((rigid.forward(POSE) - true.forward(POSE))[:3, 3])
    near = POSE + 0.05
    left = np.linalg.norm((baked.forward(near) - true.forward(near))[:3, 3])
    assert left < 0.15 * gap
    assert not with_baked_sag(YIELDING, payload, POSE).compliance.any()


def test_what_cannot_be_baked_in_is_refused_with_the_reason():
    with pytest.raises(ValueError, match=r"no compliances .* calibrate with --compliance"):
        with_baked_sag(ROBOT, 7.0, POSE)
    with pytest.raises(ValueError, match=r"must be between 0 and 7.0 kg, got 8.0 kg"):
        with_baked_sag(YIELDING, 8.0, POSE)

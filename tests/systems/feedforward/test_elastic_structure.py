"""The approximate inverse of a structure that yields: right at rest, bounded always, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant

from robots.description.drive_parts import Cubic
from robots.description.model import RobotModel, load_robot
from robots.dynamics.modes import stretched
from robots.dynamics.plant import add_robot
from robots.kinematics.forward import Kinematics
from robots.pose import pose_error
from systems.controller_model import ControllerModel
from systems.feedforward import FeedforwardConfig, JointReference
from systems.feedforward.config import CorrectionConfig
from systems.feedforward.elastic_structure import ElasticStructureFeedforward
from systems.feedforward.flexible_joint import FlexibleJointFeedforward

PERIOD = 4e-3
ROBOTS = {"irb1200": 7.0, "kr16": 16.0, "kr210": 210.0}
# In degrees of the KR16: the arm level ahead, and upright over axis 2; the wrist is singular in both.
SINGULAR = {
    "stretched": [0, 0, 3, 0, 0, 0],
    "upright": [0, -90, 3, 0, 0, 0],
    "over axis 1": [0, -90, -22, 0, 0, 0],
}


def still(q: np.ndarray) -> JointReference:
    return JointReference(q, np.zeros(6), np.zeros(6))


def model(name: str, **settings) -> ElasticStructureFeedforward:
    config = FeedforwardConfig("elastic_structure", **settings)
    return ElasticStructureFeedforward(ControllerModel(load_robot(name), ROBOTS[name], PERIOD), config)


def working(robot: RobotModel) -> np.ndarray:
    """Away from singular positions: the elbow and the wrist bent by about a radian from stretched."""
    q = stretched(robot)
    return np.clip(q + np.array([0.4, -0.5, 1.0, 0.3, 1.0, 0.2]), robot.lower, robot.upper)


def stiffened(robot: RobotModel, factor: float) -> RobotModel:
    """With bearings and beams that much stiffer."""
    joints = [
        replace(
            joint, tilting=replace(joint.tilting, stiffness=[factor * k for k in joint.tilting.stiffness])
        )
        if joint.tilting
        else joint
        for joint in robot.joints
    ]
    links = [
        replace(link, beam=replace(link.beam, stiffness=factor * link.beam.stiffness)) if link.beam else link
        for link in robot.links
    ]
    return replace(robot, joints=joints, links=links)


def stiffening(robot: RobotModel) -> RobotModel:
    """Bearings and beams a tenth to a third stiffer under load."""
    joints = [
        replace(joint, tilting=replace(joint.tilting, stiffening_a=Cubic(3e6), stiffening_b=Cubic(3e6)))
        if joint.tilting
        else joint
        for joint in robot.joints
    ]
    return replace(robot, joints=joints)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("stiffens", [False, True])
def test_at_rest_the_sagging_robot_has_its_tip_where_it_shall_be(name: str, stiffens: bool):
    """The model's section torques are those of an arm that does not sag, wrong by a share of its angles."""
    robot = stiffening(load_robot(name)) if stiffens else load_robot(name)
    left, sag = left_and_sag(robot, robot, name)
    assert sag > 3e-4
    assert left < 0.004 * sag


def test_the_inverse_of_springs_believed_to_be_linear_leaves_what_the_true_ones_do_not_yield():
    robot = load_robot("kr210")
    wrong, sag = left_and_sag(stiffening(robot), robot, "kr210")
    right, _ = left_and_sag(stiffening(robot), stiffening(robot), "kr210")
    assert wrong > 0.03 * sag
    assert right < 0.1 * wrong


def left_and_sag(truth: RobotModel, belief: RobotModel, name: str) -> tuple[float, float]:
    """How far the tip at rest is off in m with the inverse of what is believed, and without any."""
    q = working(truth)
    config = FeedforwardConfig("elastic_structure")
    inverse = ElasticStructureFeedforward(ControllerModel(belief, ROBOTS[name], PERIOD), config)
    answer = inverse.answer(still(q), inverse.fresh_memory())
    plant = MultibodyPlant(0.0)
    parts = add_robot(plant, truth, "structure", ROBOTS[name])
    plant.Finalize()
    context = plant.CreateDefaultContext()
    parts.set_at_rest(context, answer.position)
    X_WE, wanted = parts.tool.CalcPoseInWorld(context).GetAsMatrix4(), Kinematics(truth).forward(q)
    left = float(np.linalg.norm(pose_error(wanted, X_WE)[3:]))
    parts.set_at_rest(context, q)
    sag = float(np.linalg.norm(parts.tool.CalcPoseInWorld(context).translation() - wanted[:3, 3]))
    return left, sag


def test_a_stiff_structure_leaves_the_flexible_joint():
    """Structure a million times stiffer deflects by nanoradians."""
    robot = stiffened(load_robot("kr16"), 1e6)
    found, expected = (
        kind(ControllerModel(robot, 16.0, PERIOD), FeedforwardConfig())
        for kind in (ElasticStructureFeedforward, FlexibleJointFeedforward)
    )
    memories, q = [found.fresh_memory(), expected.fresh_memory()], working(robot)
    for tick in range(50):
        s, rate = np.sin(12.0 * PERIOD * tick), 12.0 * np.cos(12.0 * PERIOD * tick)
        reference = JointReference(q + 0.05 * s, np.full(6, 0.05 * rate), np.full(6, -0.05 * 144.0 * s))
        a, b = (
            each.answer(reference, memory) for each, memory in zip((found, expected), memories, strict=True)
        )
        memories = [a.memory, b.memory]
    np.testing.assert_allclose(a.position, b.position, atol=1e-8)
    np.testing.assert_allclose(a.torque, b.torque, rtol=1e-4, atol=0.05)


@pytest.mark.parametrize("method", ["least_squares", "geometric"])
@pytest.mark.parametrize("pose", SINGULAR)
def test_through_singular_positions_the_outputs_stay_bounded(method: str, pose: str):
    """All axes swing by 0.2 rad at 1.5 Hz: offsets of millirads, and torques that the motion asks for."""
    inverse = model("kr16", correction=CorrectionConfig(method))
    memory, q = inverse.fresh_memory(), np.deg2rad(SINGULAR[pose])
    w, size = 2.0 * np.pi * 1.5, 0.2
    rigid = 0.0
    for tick in range(200):
        s, c = np.sin(w * PERIOD * tick), np.cos(w * PERIOD * tick)
        reference = JointReference(q + size * s, np.full(6, size * w * c), np.full(6, -size * w * w * s))
        answer = inverse.answer(reference, memory)
        memory = answer.memory
        if tick < 5:  # the velocity begins with a jump, which the differences remember so long
            continue
        rigid = max(rigid, np.abs(inverse.link_load(reference)).max())
        assert np.abs(answer.position_offset).max() < 0.03
        assert np.abs(answer.velocity_offset).max() < 1.0
        assert np.abs(answer.torque).max() < 2.0 * rigid + 3e3


def test_all_elastic_parameters_are_wrong_by_the_same_share():
    q = working(load_robot("kr16"))
    right, soft = (
        model("kr16", stiffness_error=error).drive(still(q), np.full(500, np.nan)) for error in (0.0, -0.5)
    )
    # Twice the compliance, twice the deflection, but for what the sag changes in the levers.
    np.testing.assert_allclose(soft.deflection, 2.0 * right.deflection, rtol=0.02, atol=2e-6)


def test_the_correction_of_a_joint_is_limited():
    q = working(load_robot("kr210"))
    offsets = [
        model("kr210", correction=CorrectionConfig(limit_deg=limit)).drive(still(q), np.full(500, np.nan))
        for limit in (3.0, 0.01)
    ]
    gears = FlexibleJointFeedforward(ControllerModel(load_robot("kr210"), 210.0, PERIOD), FeedforwardConfig())
    of_gears = gears.drive(still(q), np.full(gears.memory_size, np.nan)).deflection
    free, limited = (np.abs(each.deflection - of_gears).max() for each in offsets)
    assert free > 5e-4
    assert limited < np.deg2rad(0.01) + 5e-5  # what the limiter's tails and the changed load of the gears add


@pytest.mark.parametrize(
    ("correction", "message"),
    [
        (
            CorrectionConfig("newton"),
            "correction.method must be one of least_squares, geometric, direct, got 'newton'",
        ),
        (CorrectionConfig(limit_deg=0.0), "correction.limit_deg must be positive, got 0.0 deg"),
    ],
)
def test_an_impossible_correction_is_refused(correction: CorrectionConfig, message: str):
    with pytest.raises(ValueError, match=message):
        model("kr16", correction=correction)

"""Position level at every orientation: rotations have no singular one, Euler angles do and say so."""

import numpy as np
import pytest

from robots.description.model import RobotModel, load_robot
from robots.kinematics.analytic_inverse import InverseKinematics
from robots.kinematics.forward import rotation_about
from robots.pose import pose_error, rotation_from_zyx, rotation_vector
from systems.controller_model import ControllerModel
from systems.guard.guard import GuardConfig
from systems.reference.paths import ReferenceConfig, make_path
from systems.reference.shapes import Circle
from systems.servo.euler_correction import EulerCorrection
from systems.servo.law import LawInput
from systems.servo.position_level import PositionLevel, PositionLevelConfig, RotationVectorCorrection
from tests.systems.rigs import PERIOD, LawRig

ROBOT = load_robot("irb1200")


def looking(beta_deg: float) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3] = rotation_from_zyx(np.deg2rad([10.0, beta_deg, 20.0]))
    X[:3, 3] = 0.45, 0.0, 0.4
    return X


def tilted_tool() -> RobotModel:
    robot = load_robot("irb1200")
    robot.tool.zyx_deg = np.array([4.0, 3.0, 5.0])
    return robot


def error_at_rest(beta_deg: float, angles: str = "rotation_vector") -> float:
    """The angle in rad that is left after ten time constants with a tool that is tilted by 7 degrees."""
    X = looking(beta_deg)
    q = InverseKinematics(ROBOT).nearest(X, np.zeros(6))
    config = PositionLevelConfig(rotation=5.0, translation=5.0, angles=angles)
    rig = LawRig("position_level", ROBOT, lambda time: (X, np.zeros(6)), q, true=tilted_tool(), config=config)
    return float(np.linalg.norm(pose_error(X[None], rig.run(2.0))[-1, :3]))


@pytest.mark.parametrize("beta_deg", [60.0, 80.0, 89.0, 90.0])
def test_a_tilted_tool_is_straightened_at_every_orientation(beta_deg: float):
    assert error_at_rest(beta_deg) < 1e-5  # exp(-10) of 7 degrees, 5.5e-6


def test_euler_angles_do_as_well_where_they_are_regular_and_not_where_they_are_not():
    assert error_at_rest(60.0, "euler") < 1e-5
    assert error_at_rest(89.0, "euler") > 1e-3


@pytest.mark.parametrize("size", [0.1, 1.0, 3.0])
def test_a_constant_turn_dies_by_its_gain_however_large_it_is(size: float):
    """R_WE = R_WC D with a constant D: each step leaves 1 - K dt of the error, exactly."""
    correction, R_WD = RotationVectorCorrection(), rotation_from_zyx(np.array([0.3, 1.4, -2.0]))
    D = rotation_about(np.array([0.6, 0.0, 0.8]), size)
    turn, gain = np.zeros(3), 5.0
    for step in range(4):
        R_WC, _, _ = correction.command(turn, np.zeros(3), R_WD, np.zeros(3))
        error = correction.rate(_rows(R_WD), _rows(R_WC @ D))
        assert np.linalg.norm(error) == pytest.approx(size * (1.0 - gain * PERIOD) ** step, rel=1e-9)
        turn = correction.moved(turn, gain * PERIOD * error)


@pytest.mark.parametrize("is_seen", [True, False])
def test_the_compiled_step_is_that_of_the_class_to_rounding(is_seen: bool):
    """Also where the correction stands at its limits."""
    config = PositionLevelConfig(correction_limit=0.02, correction_limit_deg=2.0)
    law = PositionLevel(ControllerModel(ROBOT), config, GuardConfig())
    rng = np.random.default_rng(1)
    for scale in (1e-3, 0.03, 0.3):
        X, V, seen = looking(80.0)[:3].copy(), rng.normal(size=6), looking(80.0 + 50.0 * scale)[:3].copy()
        seen[:, 3] += scale * rng.normal(size=3)
        q = InverseKinematics(ROBOT).nearest(looking(80.0), np.zeros(6))
        memory = np.concatenate([scale * rng.normal(size=6), q, np.zeros(12)])
        moment = LawInput(X, V, q, (X, seen) if is_seen else None)
        compiled, written = law.step(moment, memory.copy()), law._step_as_written(moment, memory.copy())
        for one, other in zip(compiled, written, strict=True):
            np.testing.assert_allclose(one, other, atol=1e-9)  # joints are 1e3 of rounding near a singularity


@pytest.mark.parametrize("form", [RotationVectorCorrection, EulerCorrection])
def test_the_commanded_angular_velocity_is_that_of_the_commanded_orientation(form: type):
    """By central differences, while both the path and the correction turn."""
    correction, h = form(), 1e-5
    R_0, w_WD = rotation_from_zyx(np.array([0.3, 0.5, -2.0])), np.array([0.4, -0.3, 0.8])
    turn, rate = np.array([0.1, -0.2, 0.15]), np.array([0.5, 0.2, -0.4])

    def commanded(t: float) -> np.ndarray:
        speed = float(np.linalg.norm(w_WD))
        R_WD = rotation_about(w_WD / speed, speed * t) @ R_0
        return correction.command(correction.moved(turn, t * rate), rate, R_WD, w_WD)[0]

    _, w_WC, _ = correction.command(turn, rate, R_0, w_WD)
    measured = rotation_vector(commanded(h) @ commanded(-h).T) / (2.0 * h)
    assert w_WC == pytest.approx(measured, abs=1e-8)


def test_euler_angles_refuse_a_path_near_their_singular_orientation():
    def law(beta_deg: float, angles: str) -> None:
        circle = Circle(radius_mm=60.0, zyx_deg=np.array([0.0, beta_deg, 0.0]))
        path = make_path(ReferenceConfig(circle))
        PositionLevel(ControllerModel(ROBOT), PositionLevelConfig(angles=angles), GuardConfig()).check_path(
            path
        )

    law(70.0, "euler")
    law(90.0, "rotation_vector")
    with pytest.raises(ValueError, match=r"within 70 degrees, the path reaches 71\.0"):
        law(71.0, "euler")
    with pytest.raises(ValueError, match="angles must be one of rotation_vector, euler, got 'quaternion'"):
        law(0.0, "quaternion")


def _rows(R: np.ndarray) -> np.ndarray:
    return np.column_stack([R, np.zeros(3)])

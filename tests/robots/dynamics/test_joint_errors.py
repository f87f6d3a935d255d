"""Errors of joints that depend on their angles: added, differentiated, identified, kept, inverted."""

from dataclasses import replace

import numpy as np
import pytest

from robots.calibration.identification import IdentificationConfig, identify
from robots.calibration.measurements import Measurements
from robots.description.joint_errors import ALL, KINDS, JointErrors, names_of
from robots.description.model import RobotFileError, RobotModel, load_robot
from robots.description.robot_file import robot_text
from robots.dynamics.compliant_kinematics import CompliantKinematics, controller_kinematics
from robots.dynamics.newton_inverse import inverse_kinematics
from robots.kinematics.forward import Kinematics
from robots.pose import pose_error

Q = np.array([0.3, -0.4, 0.5, 1.1, -0.9, 2.0])


def erring(values: dict[str, float], compliance: float = 0.0) -> RobotModel:
    robot = load_robot("irb1200")
    yielding = (compliance / robot.joint_stiffness).tolist()
    return replace(
        robot, calibration=replace(robot.calibration, joint_errors=values, compliance=yielding, of="irb1200")
    )


def test_each_error_is_the_formula_of_its_name():
    values = {"scale_2": 1e-3, "sine_3": 2e-3, "cosine_4": 3e-3, "coupling_46": 4e-3}
    values |= {"motor_cosine_1": 5e-4, "wave_sine_5": 6e-4}
    ratio = load_robot("irb1200").gear_ratio
    added = JointErrors(tuple(values), ratio).added(Q, np.array(list(values.values())))
    turning = [5e-4 * np.cos(ratio[0] * Q[0]), 6e-4 * np.sin(2.0 * ratio[4] * Q[4])]
    expected = [turning[0], 1e-3 * Q[1], 2e-3 * np.sin(Q[2]), 3e-3 * np.cos(Q[3]), turning[1], 4e-3 * Q[3]]
    np.testing.assert_allclose(added, expected, atol=1e-18)
    X = controller_kinematics(erring(values)).forward(Q)
    np.testing.assert_allclose(X, Kinematics(load_robot("irb1200")).forward(Q + expected), atol=1e-15)


@pytest.mark.parametrize("compliance", [0.0, 1.0])
def test_the_jacobian_knows_that_errors_change_with_the_angle(compliance: float):
    fast = ("motor", "wave")  # hundreds of times in a turn: less of them, for the differences' sake
    values = {name: 2e-5 if name.startswith(fast) else 2e-2 for name in ALL}
    kinematics = CompliantKinematics(erring(values, compliance), 3.0)
    X, J = kinematics.forward_and_jacobian(Q)
    for joint in range(6):
        step = 1e-5 * np.eye(6)[joint]
        slope = pose_error(kinematics.forward(Q + step), kinematics.forward(Q - step)) / 2e-5
        # Compliances move the joints by 1e-3, and their derivative is of first order only.
        np.testing.assert_allclose(J[:, joint], slope, atol=1e-8 if not compliance else 2e-4)
    np.testing.assert_allclose(X, kinematics.forward(Q), atol=1e-15)


@pytest.mark.slow
def test_they_are_identified_kept_in_a_file_and_inverted(tmp_path):
    """Without noise: eccentric gears of 0.03 degrees and wrist axes that turn each other along."""
    rng = np.random.default_rng(1)
    values = dict(zip(ALL, 5e-4 * rng.uniform(-1.0, 1.0, len(ALL)), strict=True))
    true, nominal = controller_kinematics(erring(values)), load_robot("irb1200")
    q = rng.uniform(0.9 * nominal.lower, 0.9 * nominal.upper, (150, 6))
    X = true.forward(q)
    table = Measurements(q, X[:, :3, 3], X[:, :3, :3])
    found = identify(nominal, table, IdentificationConfig(joint_errors=tuple(KINDS)))
    (tmp_path / "robot.yaml").write_text(robot_text(found.calibrated_robot("irb1200")))
    robot = load_robot(str(tmp_path / "robot.yaml"))
    fresh = rng.uniform(nominal.lower, nominal.upper, (50, 6))
    assert np.abs(controller_kinematics(robot).forward(fresh) - true.forward(fresh)).max() < 1e-10
    assert np.abs(Kinematics(nominal).forward(fresh) - true.forward(fresh))[:, :3, 3].max() > 5e-4
    X_wanted = true.forward(Q)
    q_found = inverse_kinematics(robot).nearest(X_wanted, Q + 1e-3)
    assert np.abs(true.forward(q_found) - X_wanted).max() < 1e-10


def test_unknown_kinds_and_names_are_refused(tmp_path):
    with pytest.raises(
        ValueError, match="joint errors are scale, eccentricity, motor, strain_wave, coupling, got 'backlash'"
    ):
        names_of(["backlash"])
    (tmp_path / "robot.yaml").write_text("extends: irb1200\ncalibration: {joint_errors: {scale_7: 1.0e-3}}\n")
    with pytest.raises(RobotFileError, match="'scale_7' is none of"):
        load_robot(str(tmp_path / "robot.yaml"))

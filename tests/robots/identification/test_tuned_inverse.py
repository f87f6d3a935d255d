"""The numbers of an inverse model by name: each changes what it says, and nothing else."""

import numpy as np
import pytest

from robots.description.drive_parts import Stribeck
from robots.description.model import load_robot
from robots.identification.fine_tuning.tuned_inverse import believed_sigma, true_factor, tunable, tuned_robot
from robots.identification.identified_robot import FoundParameter

ROBOT = load_robot("kr210-realistic")


def test_a_robot_has_its_springs_dampers_frictions_and_lag():
    names = tunable(ROBOT)
    assert {"stiffness_gear_6", "stiffness_bearing_2_b", "stiffness_beam_2_y", "motor_lag"} <= set(names)
    assert {"friction_1", "damping_gears", "damping_beams"} <= set(names)
    assert "stiffness_beam_3_y" not in names
    assert "motor_lag" not in tunable(load_robot("kr210"))


@pytest.mark.parametrize("name", [each for each in tunable(ROBOT) if each.startswith(("stiffness", "motor"))])
def test_a_factor_of_a_number_is_one_over_that_back(name: str):
    changed = tuned_robot(ROBOT, {name: 1.07})
    assert true_factor(name, ROBOT, changed) == pytest.approx(1.07)
    others = [each for each in tunable(ROBOT) if each != name]
    assert {true_factor(each, ROBOT, changed) for each in others} <= {1.0, None}


def test_dampers_of_a_kind_and_friction_change_together():
    changed = tuned_robot(ROBOT, {"damping_gears": 1.1, "friction_2": 0.9})
    np.testing.assert_allclose(changed.joint_damping, 1.1 * ROBOT.joint_damping)
    np.testing.assert_allclose(changed.joint_stiffness, ROBOT.joint_stiffness)
    for joint, factor in ((0, 1.0), (1, 0.9)):
        before, after = (each.joints[joint].drive_train.friction for each in (ROBOT, changed))
        assert isinstance(before, Stribeck)
        assert isinstance(after, Stribeck)
        np.testing.assert_allclose(
            [after.viscous, after.coulomb, after.hump],
            factor * np.array([before.viscous, before.coulomb, before.hump]),
        )


def test_a_source_says_that_its_spring_was_tuned():
    changed = tuned_robot(ROBOT, {"stiffness_gear_2": 1.031, "stiffness_bearing_2_b": 0.98})
    assert changed.joints[1].drive_train.source == "assumed; stiffness fine tuned on the robot, +3.1%"
    tilting = changed.joints[1].tilting
    assert tilting is not None
    assert tilting.source == "assumed; stiffness fine tuned on the robot, about b -2.0%"
    assert changed.joints[0].drive_train.source == "assumed"


def test_what_identification_has_left_unsure_is_unsure():
    rows = [
        FoundParameter("stiffness_gear_2", "Nm/rad", 2e6, 1e4, True),
        FoundParameter("stiffness_gear_6", "Nm/rad", 2e5, 1e3, False),
        FoundParameter("damping_gear_1", "s", 1e-3, 2e-5, True),
        FoundParameter("damping_gear_2", "s", 1e-3, 5e-5, True),
        FoundParameter("viscous_friction_1", "Nms/rad", 100.0, 1.0, True),
        FoundParameter("coulomb_friction_1", "Nm", 100.0, 40.0, False),
    ]
    sigma = {name: believed_sigma(name, rows, 0.2) for name in tunable(ROBOT)}
    assert sigma["stiffness_gear_2"] == pytest.approx(5e-3)
    assert sigma["damping_gears"] == pytest.approx(0.05)
    assert sigma["stiffness_gear_6"] == sigma["friction_1"] == sigma["stiffness_beam_2_x"] == 0.2

"""What a fit says of the parameters of a robot file, and how sure it is."""

import numpy as np
import pytest

from robots.description.drive_parts import Backlash
from robots.description.model import load_robot
from robots.identification.arm_along_motion import ElasticArm
from robots.identification.arm_fit import ArmFit
from robots.identification.elastic_parameters import ElasticParameters
from robots.identification.identified_robot import found_parameters, identified_robot

OWN = 1e-3  # standard deviation of every unknown but one spring


def test_a_hysteresis_is_known_no_better_than_the_spring_that_it_is_a_share_of():
    """A gear that does not slip shows k (1 + h) alone: 4 % of k are 0.04 (1 + h) of h."""
    robot = load_robot("kr210")
    parameters = ElasticParameters(ElasticArm(robot, 210.0, []), gear_parts=True)
    sigma = np.full(len(parameters), OWN)
    sigma[[spring.name for spring in parameters.springs].index("stiffness_gear_6")] = 0.04
    values = parameters.start.copy()
    values[parameters.of_kind("hysteresis")] = 0.1
    covariance = np.diag(sigma**2)
    fit = ArmFit(parameters, values, covariance, covariance, np.ones(3), 1, 1.0)
    found = {each.name: each for each in found_parameters(robot, fit)}
    assert found["hysteresis_gear_6"].sigma == pytest.approx(1.1 * 0.04, rel=1e-3)
    assert found["hysteresis_gear_1"].sigma == pytest.approx(OWN * np.hypot(1.0, 1.1))
    assert found["play_gear_6"].sigma == pytest.approx(found["play_gear_1"].sigma)
    assert found["hysteresis_gear_1"].identifiable
    assert not found["hysteresis_gear_6"].identifiable


@pytest.mark.parametrize("kind", ["play", "hysteresis"])
def test_a_gear_that_is_found_a_trace_below_none_has_none(kind: str):
    robot = load_robot("puma560")
    parameters = ElasticParameters(ElasticArm(robot, 2.5, []), gear_parts=True)
    values = parameters.start.copy()
    values[parameters.of_kind(kind)] = -1e-3
    covariance = OWN**2 * np.eye(len(parameters))
    found = identified_robot(robot, ArmFit(parameters, values, covariance, covariance, np.ones(3), 1, 1.0))
    for joint in found.joints:
        parts = joint.drive_train
        assert isinstance(parts.backlash, Backlash)
        assert parts.hysteresis is not None
        none = {"play": parts.backlash.arc_minutes, "hysteresis": parts.hysteresis.stiffness[0]}
        assert none[kind] == 0.0

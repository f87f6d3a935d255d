"""A path whose orientation is the singular one of Euler angles, on the elastic robot with wrong joints."""

import numpy as np
import pytest

from diagrams.runs.simulation import Experiment
from tests.diagrams.rigs import QUIET, scenario, true_errors

CIRCLE = ["reference.path=circle", "reference.path.radius_mm=60", "reference.path.zyx_deg=[0, 90, 0]"]
TIMES = ["reference.settle=1", "reference.acceleration=8", "reference.dwell=1.5"]


def test_position_level_comes_to_rest_where_it_should():
    experiment = Experiment(scenario("misaligned", *CIRCLE, *TIMES, *QUIET), "position_level")
    experiment.advance()
    _, errors = true_errors(experiment)
    at_rest = np.abs(errors[-1])
    assert np.rad2deg(at_rest[:3]).max() < 0.02
    assert 1e3 * at_rest[3:].max() < 0.1


def test_its_euler_form_refuses_the_path_before_anything_moves():
    euler = "servo.laws.position_level.angles=euler"
    with pytest.raises(ValueError, match=r"needs beta within 70 degrees, the path reaches 90\.0"):
        Experiment(scenario("misaligned", *CIRCLE, euler), "position_level")

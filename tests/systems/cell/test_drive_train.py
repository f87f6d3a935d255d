"""Drive trains by themselves: how far gears yield, and their friction."""

import numpy as np
import pytest

from robots.description.model import load_robot
from systems.cell.drive_train import CoulombFriction, ElasticDriveTrain

ROBOT = load_robot("irb1200")


@pytest.mark.parametrize("v", [np.linspace(-0.02, 0.03, 6), np.full(6, 2.0), np.full(6, -2.0)])
def test_coulomb_friction_is_of_each_joint_for_itself_and_grows_with_the_gear(v: np.ndarray):
    """-d_c i tanh(v / eps), eq. (2.64) of Probst (2024), in a context as it comes."""
    friction = CoulombFriction(ROBOT)
    context = friction.CreateDefaultContext()
    friction.get_input_port().FixValue(context, np.concatenate([np.ones(6), v]))
    expected = [
        -d.coulomb_friction * d.ratio * np.tanh(x / d.coulomb_velocity)
        for d, x in zip([joint.drive_train for joint in ROBOT.joints], v, strict=True)
    ]
    np.testing.assert_allclose(friction.get_output_port().Eval(context), expected, rtol=1e-12)


def test_gears_yield_to_a_load_by_their_compliance():
    load = np.array([0.0, 50.0, 30.0, 1.0, -5.0, 0.5])
    np.testing.assert_allclose(
        ElasticDriveTrain(ROBOT).wind_up(load, np.zeros(6)), load / ROBOT.joint_stiffness
    )

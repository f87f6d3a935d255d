"""Friction as a line with a jump, from either way in which a robot file says it."""

import pytest

from robots.description.model import load_robot
from robots.dynamics.friction_line import friction_line


@pytest.mark.parametrize("name", ["kr16", "kr16-realistic"])
def test_friction_is_what_the_robot_says_wherever_it_says_so(name: str):
    """The realistic robot's file has 30 % more of both, and a hump that falls a little there."""
    plain = load_robot("kr16")
    coulomb, viscous = friction_line(load_robot(name))
    share = 1.3 if name != "kr16" else 1.0
    assert coulomb == pytest.approx(share * plain.joint_coulomb_friction, rel=0.05)
    assert viscous == pytest.approx(share * plain.joint_viscous_friction, rel=0.15)

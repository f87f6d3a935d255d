"""The protective distance: its terms, and the speed at which a distance suffices."""

import numpy as np
import pytest

from systems.guard.separation.protective_distance import (
    ReactionTime,
    SeparationConfig,
    largest_share,
    protective_distance,
    stopping_time,
)

REACTION = ReactionTime(images=0.05, transport=0.03, computation=0.05, decision=0.02, command=0.01)
CONFIG = SeparationConfig()


def test_terms_are_those_of_motion_at_constant_speed_until_the_robot_stands():
    """Person and robot walk towards each other for T_r, then the robot brakes evenly for T_s."""
    v_h, v_r, T_s = 1.6, 1.2, 0.25
    terms = protective_distance(CONFIG, REACTION, v_r, T_s, v_h)
    time = np.linspace(0.0, REACTION.total + T_s, 20001)
    speed = v_r * np.clip((REACTION.total + T_s - time) / T_s, 0.0, 1.0)
    nearer = np.trapezoid(v_h + speed, time)
    assert terms.human + terms.reaction + terms.stopping == pytest.approx(nearer, rel=1e-6)
    assert terms.total - nearer == pytest.approx(CONFIG.intrusion + CONFIG.person_error + CONFIG.robot_error)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_at_the_largest_share_the_distance_is_the_protective_one(share):
    full = protective_distance(CONFIG, REACTION, 1.5, 0.25, 1.6)
    slowed = protective_distance(CONFIG, REACTION, share * 1.5, 0.25, 1.6)
    assert largest_share(slowed.total, full) == pytest.approx(share)
    assert largest_share(full.total, full) == pytest.approx(1.0)
    assert largest_share(full.at_rest, full) == pytest.approx(0.0)


def test_a_robot_that_cannot_brake_as_hard_needs_longer():
    velocity = np.array([1.0, 0.0, -3.0, 0.0, 0.0, 0.0])
    assert stopping_time(0.25, velocity, np.full(6, 100.0)) == 0.25
    assert stopping_time(0.25, velocity, np.full(6, 5.0)) == pytest.approx(0.6)

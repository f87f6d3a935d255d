"""Commands that make up for friction keep a joint's largest acceleration, whatever friction asks for."""

import numpy as np
import pytest

from robots.description.model import load_robot
from systems.estimation.drives.drive_model import SHARP
from systems.estimation.drives.gain_search import Gains
from tests.systems.estimation.drives.motors import LOADS, PERIOD, drives

ROBOT = load_robot("kr16")
W = 6.0  # rad/s, of the motion
SIZE = 0.6 / W**2  # of it, rad
TICKS = 600


def swing(time: float):
    """Position, velocity and acceleration of six joints, which turn over one after the other, from rest."""
    u = W * time - 0.5 * np.arange(6)
    s, c = np.sin(u), np.cos(u)
    return SIZE * s, SIZE * W * c, -SIZE * W**2 * s


def commanded(takes_torque: bool, is_bounded: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and what of positions is beside the plan by what was learnt, (n, 6) each.

    Friction turns over more sharply than believed, in drives that are a tenth as stiff.
    """
    model, memory = drives(takes_torque, "kr16")
    model.prepare_gains(memory, Gains(1.0, 1.0, np.full(6, 10.0)))
    model.take_gains(memory)
    if not is_bounded:
        model._drives = model._drives._replace(acceleration=np.full(6, 1e9))
    memory.beta[SHARP] = 1.0
    found = [model.command(memory, swing(PERIOD * k), LOADS, 7.0) for k in range(TICKS)]
    position, velocity, beside = (
        np.array([getattr(command, name) for command in found]) for name in ("position", "velocity", "beside")
    )
    return position, velocity, beside


@pytest.mark.parametrize("takes_torque", [False, True])
def test_no_joint_is_accelerated_more_than_it_may_be_and_soon_all_is_made_up_for(takes_torque: bool):
    position, velocity, beside = commanded(takes_torque, True)
    free, _, its_beside = commanded(takes_torque, False)
    most = ROBOT.acceleration
    asked = np.abs(np.diff(free, 2, axis=0)) / PERIOD**2
    assert (asked > 1.2 * most).any()
    assert (np.abs(np.diff(position, 2, axis=0)) / PERIOD**2 <= most).all()
    assert (np.abs(np.diff(velocity, axis=0)) / PERIOD <= most).all()
    # What is left out counts as beside the plan, or friction would be learnt from it.
    np.testing.assert_allclose(position - free, beside - its_beside, atol=1e-12)
    is_other = (position != free).any(axis=1)
    assert 0.0 < is_other.mean() < 0.05

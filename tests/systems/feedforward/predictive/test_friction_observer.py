"""What motors need beyond the feedforward: friction, which ends with the motion, and a load, which stays."""

import numpy as np
import pytest

from robots.description.model import NUM_JOINTS
from systems.feedforward.predictive.friction_observer import FrictionObserver

COULOMB, VISCOUS, WIDTH = np.full(NUM_JOINTS, 0.5), np.full(NUM_JOINTS, 0.3), np.full(NUM_JOINTS, 0.01)


def test_friction_is_parted_from_load():
    """A motion to and fro with a third more friction and a constant load tells them apart to a twentieth."""
    observer = FrictionObserver(COULOMB, VISCOUS, WIDTH)
    memory, load = observer.at_first, 0.02
    for time in 4e-3 * np.arange(500):
        speed = np.full(NUM_JOINTS, 0.8 * np.sin(2.0 * np.pi * time))
        needed = (COULOMB * np.tanh(speed / WIDTH) + VISCOUS * speed) / 3.0 + load
        memory = observer.updated(memory, needed, speed)
    fast, still = np.full((1, NUM_JOINTS), 0.5), np.zeros((1, NUM_JOINTS))
    both = COULOMB / 3.0 + 0.5 * VISCOUS / 3.0
    assert observer.ahead(memory, fast)[0] - load == pytest.approx(both, rel=0.05)
    assert observer.ahead(memory, -fast)[0] - load == pytest.approx(-both, rel=0.05)
    assert observer.ahead(memory, still)[0] == pytest.approx(load, abs=0.005)


def test_nothing_is_expected_at_first():
    observer = FrictionObserver(COULOMB, VISCOUS, WIDTH)
    assert np.array_equal(
        observer.ahead(observer.at_first, np.ones((3, NUM_JOINTS))), np.zeros((3, NUM_JOINTS))
    )

"""A gear at the end of a step carries what the parts of the drive trains say of the same motion."""

import math

import numpy as np
import pytest

from robots.drivetrain.dahl import DahlHysteresis
from robots.drivetrain.stiffness import CubicSpring
from robots.drivetrain.train import DriveTrains, JointTrain
from robots.identification.response_kernels import gear_step

STIFFNESS, TIME, LUBRICANT, SHARE, WIDTH = 1e6, 1e-3, 0.3, 0.1, 5e-4


def gear(play: float) -> np.ndarray:
    damper = TIME * STIFFNESS
    oil = LUBRICANT * damper if play else 0.0
    return np.array([STIFFNESS, damper, 0.5 * play, oil, SHARE * STIFFNESS, WIDTH])


def trains(play: float) -> DriveTrains:
    damping = TIME * STIFFNESS
    train = JointTrain(
        CubicSpring(STIFFNESS, 0.0),
        damping,
        1.0,
        gap=play,
        lubricant=LUBRICANT * damping if play else 0.0,
        hysteresis=DahlHysteresis((SHARE * STIFFNESS,), (WIDTH,)),
    )
    return DriveTrains([train] * 6)


@pytest.mark.parametrize("play", [0.0, 1.5e-4])
def test_it_agrees_with_the_drive_trains_of_the_plant(play: float):
    rng, none = np.random.default_rng(0), np.zeros(6)
    hysteresis = DahlHysteresis((SHARE * STIFFNESS,), (WIDTH,))
    for _ in range(100):
        before, turn = 3e-4 * rng.uniform(-1.0, 1.0, 2)
        z, rate = 4e-4 * rng.uniform(-1.0, 1.0), rng.uniform(-0.1, 0.1)
        torque, state, *_ = gear_step(gear(play), before, z, turn, rate)
        moved = hysteresis.moved(np.full((6, 1), z), np.full(6, turn - before))
        assert state == pytest.approx(moved[0, 0], abs=1e-15)
        found = trains(play).torques(moved.ravel(), (none, none), (np.full(6, turn), np.full(6, rate)), none)
        assert torque == pytest.approx(-found.link[0], rel=1e-9, abs=1e-6)


@pytest.mark.parametrize("play", [0.0, 1.5e-4])
@pytest.mark.parametrize("turn", [-3e-4, -1e-4, 2e-5, 1.2e-4, 2e-4, 3e-4])
def test_derivatives_are_differences(play: float, turn: float):
    before, z, rate, h = 1e-4, 5e-5, 0.02, 1e-10
    _, _, by_turn, by_rate, kept, state_by_turn, *_ = gear_step(gear(play), before, z, turn, rate)

    def difference(of: int, turn_by: float = 0.0, rate_by: float = 0.0, z_by: float = 0.0) -> float:
        ahead, behind = (
            gear_step(gear(play), before, z + s * z_by, turn + s * turn_by, rate + s * rate_by)[of]
            for s in (1.0, -1.0)
        )
        return (ahead - behind) / (2.0 * h)

    assert difference(0, turn_by=h) == pytest.approx(by_turn, rel=1e-3)
    assert difference(0, rate_by=h) == pytest.approx(by_rate, rel=1e-3)
    assert difference(1, turn_by=h) == pytest.approx(state_by_turn, rel=1e-3)
    assert difference(1, z_by=h) == pytest.approx(kept, rel=1e-3)


def test_a_step_of_a_straight_gear_knows_no_play():
    torque, _, _, _, _, _, out, elastic, damped, oiled = gear_step(gear(0.0), 0.0, 0.0, 2e-4, 0.01)
    assert (out, oiled) == (1.0, 0.0)
    assert elastic == pytest.approx(STIFFNESS * 2e-4 + damped)
    assert torque == pytest.approx(elastic + SHARE * STIFFNESS * WIDTH * (1.0 - math.exp(-0.4)))

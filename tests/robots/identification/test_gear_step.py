"""Gears at the end of a step carry what the parts of the drive trains say of the same motion."""

import numpy as np
import pytest

from robots.drivetrain.dahl import DahlHysteresis
from robots.drivetrain.stiffness import CubicSpring
from robots.drivetrain.train import DriveTrains, JointTrain
from robots.identification.elastic_parameters import ArmNumbers
from robots.identification.gear_step import Gears

STIFFNESS, TIME, LUBRICANT, SHARE, WIDTH = 1e6, 1e-3, 0.3, 0.1, 5e-4


def gears(play: float) -> Gears:
    six = np.ones(6)
    return Gears(
        ArmNumbers(STIFFNESS * six, TIME * six, play * six, LUBRICANT, SHARE * six, WIDTH, np.zeros((2, 6)))
    )


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
def test_they_agree_with_the_drive_trains_of_the_plant(play: float):
    rng = np.random.default_rng(0)
    hysteresis = DahlHysteresis((SHARE * STIFFNESS,), (WIDTH,))
    for _ in range(50):
        before, turn = 3e-4 * rng.uniform(-1.0, 1.0, (2, 1, 6))
        z, rate = 4e-4 * rng.uniform(-1.0, 1.0, (1, 6)), rng.uniform(-0.1, 0.1, (1, 6))
        step = gears(play).step(before, z, turn, rate)
        moved = hysteresis.moved(z[0, :, None], (turn - before)[0])
        np.testing.assert_allclose(step.hysteresis[0], moved[:, 0], atol=1e-15)
        found = trains(play).torques(
            moved.ravel(), (np.zeros(6), np.zeros(6)), (turn[0], rate[0]), np.zeros(6)
        )
        np.testing.assert_allclose(-found.link, step.torque[0], rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("play", [0.0, 1.5e-4])
def test_derivatives_are_differences(play: float):
    model, h = gears(play), 1e-10
    before, turn = np.full((1, 6), 1e-4), np.array([[-3e-4, -1e-4, 2e-5, 1.2e-4, 2e-4, 3e-4]])
    z, rate = np.full((1, 6), 5e-5), np.full((1, 6), 0.02)
    step = model.step(before, z, turn, rate)
    ahead, behind = (model.step(before, z, turn + sign * h, rate) for sign in (1.0, -1.0))
    np.testing.assert_allclose((ahead.torque - behind.torque) / (2.0 * h), step.by_turn, rtol=1e-3)
    faster, slower = (model.step(before, z, turn, rate + sign * h) for sign in (1.0, -1.0))
    np.testing.assert_allclose((faster.torque - slower.torque) / (2.0 * h), step.by_rate, rtol=1e-3)


def test_a_load_is_carried_beyond_the_play():
    load = 500.0 * np.array([[1.0, -1.0, 2.0, -2.0, 3.0, -3.0]])
    model = gears(1e-4)
    turn = model.at_rest(load)
    step = model.step(turn, np.zeros((1, 6)), turn, np.zeros((1, 6)))
    np.testing.assert_allclose(step.torque, load)

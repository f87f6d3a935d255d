"""What encoders show is fed back: less of what nobody foresaw is left, and no dead time makes it unstable."""

import numpy as np
import pytest

from robots.description.model import load_robot
from systems.controller_model import ControllerModel
from systems.estimation.drives.drive_config import DriveModelConfig
from systems.estimation.drives.drive_model import REGRESSORS, DriveCommand, DriveModel
from systems.estimation.drives.motor_feedback import MotorFeedback
from tests.systems.estimation.drives.motors import LOADS, PERIOD, drives, motion

STEP, STILL, ALL = 5e-4, np.zeros(6), np.ones(6)  # s
POSITION, SPEED, INTEGRAL = 25.0, 100.0, 10.0  # 1/s, of a cascade


def part(kind="cascade", **config):
    feedback = MotorFeedback(DriveModelConfig(**config), kind, True, PERIOD)
    return feedback, feedback.layout.view(np.zeros(feedback.layout.size))


def some_command():
    position, velocity, torque, beside = np.random.default_rng(0).normal(size=(4, 6))
    return DriveCommand(position, velocity, torque, beside, np.zeros(REGRESSORS), np.zeros((4, 6)))


def behind_by(disturbance, delay, duration=2.0, planned_speed=0.0, sticks=0.0, **config):
    """By how much a motor of unit inertia is off its plan, rad, every period: a cascade, late by the delay.

    ``disturbance`` is an acceleration at a time; ``sticks`` one by which friction holds it, in rad/s^2.
    """
    feedback, memory = part(**config)
    command = DriveCommand(STILL, STILL, STILL, STILL, np.zeros(REGRESSORS), np.zeros((4, 6)))
    coming, position, speed, wound, off = [(0.0, 0.0)] * (1 + round(delay / PERIOD)), 0.0, 0.0, 0.0, []
    for k in range(round(duration / PERIOD)):
        now = planned_speed * PERIOD * k
        off.append(now - position)
        told = feedback.add(memory, command, np.full(6, off[-2] if k else 0.0), STILL, ALL, delay)
        coming.append((told.position[0], told.velocity[0]))
        beside, rate = coming.pop(0)
        for i in range(round(PERIOD / STEP)):
            plan = now + planned_speed * STEP * i
            wanted = planned_speed + rate + POSITION * (plan + beside - position)
            wound += STEP * INTEGRAL * (wanted - speed)
            push = SPEED * (wanted - speed + wound) + disturbance(PERIOD * k)
            speed += STEP * push
            speed -= np.sign(speed) * min(abs(speed), STEP * sticks)
            position += STEP * speed
    return np.array(off)


@pytest.mark.parametrize("delay", [0.0, 4e-3, 8e-3])
def test_of_a_torque_that_nobody_foresaw_less_is_left(delay):
    def turns_over(t):
        return 2.0 if t % 1.0 < 0.5 else -2.0

    alone, fed_back = (behind_by(turns_over, delay, feedback=gain) for gain in (0.0, 20.0))
    assert np.abs(fed_back).max() < 0.87 * np.abs(alone).max()  # 0.77 without a delay, 0.85 with two periods
    assert fed_back.std() < 0.65 * alone.std()


@pytest.mark.parametrize("delay", [0.04, 0.14, 0.3])
def test_no_dead_time_makes_it_unstable(delay):
    alone, fed_back = (
        behind_by(lambda t: 2.0 * (t < 0.1), delay, 6.0, feedback=gain) for gain in (0.0, 20.0)
    )
    assert np.abs(fed_back).max() < 1.02 * np.abs(alone).max()
    assert np.abs(fed_back[-100:]).max() < 1e-3 * np.abs(alone).max()


@pytest.mark.parametrize("gain", [100.0, 250.0, 1000.0, 1e6])
def test_no_gain_makes_it_unstable(gain):
    alone, fed_back = (behind_by(lambda t: 2.0 * (t < 0.1), 8e-3, feedback=gain) for gain in (0.0, gain))
    assert np.abs(fed_back).max() < 1.02 * np.abs(alone).max()
    assert np.abs(fed_back[-100:]).max() < 1e-3 * np.abs(alone).max()


def test_a_motor_that_sticks_does_not_move_in_steps():
    """In place of the lag an integral would make it hang and leap by 0.18 mrad, for ever."""
    fed_back = behind_by(lambda _: 0.0, 8e-3, 6.0, planned_speed=1e-4, sticks=2.0, feedback=20.0)
    assert np.abs(fed_back[500:]).max() < 1e-5


def test_nothing_is_fed_back_that_encoders_do_not_show_nor_to_drives_that_ring():
    command = some_command()
    behind, step = STILL + 1e-3, STILL + 1e-5
    for kind, off, rounding in (
        ("cascade", np.full(6, np.nan), STILL),
        ("cascade", 1.7 * step, step),  # less than half a step of the encoder
        ("position", behind, STILL),
        ("velocity", behind, STILL),
    ):
        feedback, memory = part(kind)
        told = feedback.add(memory, command, off, rounding, ALL, 0.0)
        np.testing.assert_array_equal(np.array(told[:4]), np.array(command[:4]))


def test_what_is_fed_back_counts_as_commanded_beside_the_plan_and_is_bounded():
    feedback, memory = part()
    command = some_command()
    off = np.array([4.0, -2.0, 1.0, 0.0, 0.5, -4.0])  # rad, in proportion, so that all stay on their way
    for _ in range(1000):
        told = feedback.add(memory, command, off, STILL, ALL, 0.0)
    at_last = 0.5e-3 * off  # of more than 2 mrad drives are not the reason
    np.testing.assert_allclose(told.position - command.position, at_last, rtol=1e-6)
    np.testing.assert_allclose(told.beside - command.beside, at_last, rtol=1e-6)
    np.testing.assert_allclose(told.velocity, command.velocity, atol=1e-9)
    np.testing.assert_array_equal(told.torque, command.torque)


def test_of_motors_that_friction_moves_less_than_all_else_nothing_is_fed_back_where_torques_are_sent():
    """A PUMA 560 has most for the stiffness of its drives, and the wrist of a KR 16."""
    for name, fed_back in (("puma560", 5), ("ur10", 0), ("irb1200", 0), ("kr16", 3)):
        model, memory = drives(robot=name)
        memory.P[:] = 0.0  # whatever is known of it
        shares = model.shares_fed_back(memory)
        assert np.isin(shares, (0.0, 1.0)).all()
        assert shares.sum() == fed_back
        acts = MotorFeedback(DriveModelConfig(), "cascade", model.is_fed_back, PERIOD).acts
        assert acts == (fed_back > 0)


@pytest.mark.parametrize(("robot", "fed_back"), [("irb1200", 0), ("kr16", 3)])
@pytest.mark.parametrize("takes_torque", [True, False])
def test_of_motors_whose_gears_have_play_it_is_where_friction_moves_them_by_more(
    robot: str, fed_back: int, takes_torque: bool
):
    belief = ControllerModel(load_robot(robot), 7.0, PERIOD, takes_torque=takes_torque)
    model = DriveModel(belief, DriveModelConfig(), has_play=True)
    memory = model.layout.view(np.zeros(model.layout.size))  # as if all were known of it
    assert model.shares_fed_back(memory).sum() == fed_back
    assert model.is_fed_back == (fed_back > 0)


@pytest.mark.parametrize("robot", ["ur10", "irb1200"])
def test_where_no_torques_are_sent_it_is_fed_back_as_rotors_become_known(robot):
    model, memory = drives(takes_torque=False, robot=robot)
    assert model.is_fed_back
    later = [model.shares_fed_back(memory)]
    for k in range(500):
        q, v, a = motion(PERIOD * k)
        command = model.command(memory, (q, v, a), LOADS, 7.0)
        model.look_back(memory, (q, v, a), command.regressors, command.beside, q)
        later.append(model.shares_fed_back(memory))
    np.testing.assert_array_equal(later[0], 0.0)
    assert (np.diff(later, axis=0) >= -1e-9).all()
    assert (later[-1] > 0.0).all()
    assert later[-1][5] > 0.2  # whose rotor the motion shows best


def test_what_is_fed_back_goes_by_the_shares():
    (feedback, memory), shares = part(), np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    told = feedback.add(memory, some_command(), STILL + 1e-3, STILL, shares, 0.0)
    beside = told.position - some_command().position
    np.testing.assert_allclose(beside, shares * beside[-1], atol=1e-15)
    assert beside[-1] > 0.0

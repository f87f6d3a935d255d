"""The inverse of gears with parts undoes what drive trains do, and motors get their losses and their lag."""

import numpy as np
import pytest

from robots.description.drive_parts import Backlash, Dahl, Efficiency, FourierRatio, StickSlip, ViscoElastic
from robots.description.drive_train import DriveTrain
from robots.description.model import load_robot
from robots.drivetrain.stiffness import SpringRow
from robots.drivetrain.train import DriveTrains
from systems.controller_model import ControllerModel
from systems.feedforward import FeedforwardConfig
from systems.feedforward.flexible_joint import FlexibleJointFeedforward
from systems.feedforward.gear_parts import GearParts
from systems.feedforward.joint_motion import JointReference
from systems.feedforward.sprung_deflection import SprungDeflection

TICK = 1e-3


def train(**parts) -> DriveTrain:
    return DriveTrain(ratio=100.0, rotor_inertia=3e-5, stiffness=4.5e4, damping=80.0, **parts)


@pytest.mark.slow
def test_the_deflection_under_the_torque_of_a_drive_train_is_the_one_that_made_it():
    """Loads that keep their sign, so that the gap is closed; there the smooth crossing is exact."""
    trains = DriveTrains(
        [
            train(backlash=Backlash(0.5), hysteresis=Dahl([0.1], [5e-4])).parts(),
            train(
                ratio_error=FourierRatio([2e-5], [2.0], [30.0]), hysteresis=Dahl([0.1, 0.1], [1e-4, 1e-3])
            ).parts(),
        ]
    )
    springs = SpringRow([one.spring for one in trains.trains])
    gears = SprungDeflection(np.full(2, 4.5e4), np.full(2, 80.0), TICK, springs)
    inverse = GearParts(trains, gears)
    times = np.arange(0.0, 1.0, TICK)
    x = -2e-3 - 1e-3 * np.outer(np.sin(2.0 * np.pi * times) ** 2, [1.0, 1.0])
    rates = np.gradient(x, TICK, axis=0)
    states, memory, last, gaps = np.zeros(trains.num_states), np.zeros(0), np.zeros(2), []
    for k, t in enumerate(times):
        theta = np.full(2, 0.3 * t)
        deflection = x[k] + trains.ratio_error(theta)
        if k:
            states = trains.hysteresis_moved(states, x[k] - x[k - 1])
        moving = deflection, rates[k] + 0.0 * theta
        load = trains.torques(states, (theta, np.zeros(2)), moving, np.zeros(2)).link
        if k:
            found, memory = inverse.step(memory, last, load, theta + deflection)
        else:
            found, memory = inverse.at_rest(load, theta + deflection)
        gaps.append(found - deflection)
        last = load
    assert abs(np.array(gaps)).max() < 2e-6  # rad, of 3 mrad; the tick's share of the damper


def test_a_motor_that_lags_is_told_ahead_what_its_torque_will_change_by():
    robot, lagging = load_robot("irb1200"), load_robot("irb1200")
    for joint in lagging.joints:
        joint.drive_train.motor_lag = 3e-3
    plain, ahead = (
        FlexibleJointFeedforward(ControllerModel(each, 7.0), FeedforwardConfig("flexible_joint"))
        for each in (robot, lagging)
    )
    memories, torques = [plain.fresh_memory(), ahead.fresh_memory()], []
    step = plain.substep
    for t in np.arange(0.0, 0.4, step):
        turn = 0.2 * np.sin(4.0 * t) ** 3 * np.ones(6)
        rate = 2.4 * np.sin(4.0 * t) ** 2 * np.cos(4.0 * t) * np.ones(6)
        acceleration = (19.2 * np.sin(4 * t) * np.cos(4 * t) ** 2 - 9.6 * np.sin(4 * t) ** 3) * np.ones(6)
        reference = JointReference(turn, rate, acceleration)
        drives = [
            model.drive(reference, memory[6:]) for model, memory in zip((plain, ahead), memories, strict=True)
        ]
        memories = [np.concatenate([np.zeros(6), drive.memory]) for drive in drives]
        torques.append([drive.torque for drive in drives])
    told = np.array(torques)[10:]
    expected = told[1:, 0] + 3e-3 / step * np.diff(told[:, 0], axis=0)
    np.testing.assert_allclose(told[1:, 1], expected, rtol=1e-6, atol=1e-6 * abs(expected).max())


def test_losses_are_friction_and_the_share_of_the_load():
    trains = DriveTrains([train(friction=StickSlip(2.0, 3.0, 4.0), efficiency=Efficiency(0.8, 0.5)).parts()])
    speed = np.array([0.5])
    assert trains.losses(np.array([10.0]), speed)[0] == pytest.approx(2.0 * 0.5 + 3.0 + 10.0 / 0.8 - 10.0)
    assert trains.losses(np.array([-10.0]), speed)[0] == pytest.approx(2.0 * 0.5 + 3.0 + 10.0 - 5.0)


def test_a_gear_that_is_not_inverted_is_refused():
    robot = load_robot("irb1200")
    robot.joints[1].drive_train.backlash = ViscoElastic(2e4, 1e4, 50.0)
    with pytest.raises(ValueError, match="visco-elastic gear, which is not inverted"):
        FlexibleJointFeedforward(ControllerModel(robot), FeedforwardConfig("flexible_joint"))

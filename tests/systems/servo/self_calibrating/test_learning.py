"""What the self-calibrating law makes of a pose: the encoders of the same instant, or nothing."""

import numpy as np
import pytest
from pydrake.math import RigidTransform

from robots.description.model import load_robot
from systems.controller_model import ControllerModel
from systems.estimation.memory import Layout
from systems.samples import JointSample, PoseSample
from systems.servo.self_calibrating.config import SelfCalibratingConfig
from systems.servo.self_calibrating.learning import Learning

PERIOD, AHEAD, SPEED = 4e-3, 0.012, 0.1  # s, s, rad/s


@pytest.mark.parametrize("seconds", [0.2, 4.0])
def test_a_pose_is_held_against_encoders_of_its_instant_however_late_it_comes(seconds: float):
    """While the robot is young nothing has been forgotten: before its first message it stood there."""
    learning = Learning(ControllerModel(load_robot("irb1200"), period=PERIOD), SelfCalibratingConfig())
    layout = Layout(**learning.arrays)
    memory = layout.view(np.zeros(layout.size))
    learning.start(memory)
    memory.delay.known[0] = 1.0
    motors = learning.motors
    times = PERIOD * np.arange(round(seconds / PERIOD))
    for time in times:
        moving = np.repeat([SPEED * time, SPEED], 6)
        motors.encoders.append(memory.encoders, time, moving)
        memory.passed.theta[:] = SPEED * (time + AHEAD)
        motors.plan.append(memory.plan, time + AHEAD, memory.passed.all)
    found = []
    for late in (0.0, 0.05, 0.2, 0.4, 0.43, 0.5, 1.0):
        stamp = times[-1] - late
        pair = learning.pair(memory, stamp, np.eye(4))
        found.append(pair is not None)
        if pair is not None:
            assert pair.theta == pytest.approx(SPEED * max(stamp, 0.0), abs=1e-9)
    assert found[:3] == [True] * 3
    assert all(found) == (seconds < 1.0)


def test_a_pose_waits_for_the_encoders_of_its_instant_where_their_stamps_are_late():
    """By 20 ms: the pose of an instant comes 4 ms after it, and its joints as those of 20 ms later."""
    learning, late = (
        Learning(ControllerModel(load_robot("irb1200"), period=PERIOD), SelfCalibratingConfig()),
        0.02,
    )
    layout = Layout(**learning.arrays, start_time=(1,), planner=Layout(started=(1,)))
    memory = layout.view(np.zeros(layout.size))
    learning.start(memory)
    memory.delay.known[0] = 1.0
    found: list[tuple[float, float]] = []  # stamps and motors
    learning.estimator.clock_offset = lambda memory, time: late
    learning.estimator.add = lambda memory, pair: found.append((pair.time, float(pair.theta[0])))
    for time in PERIOD * np.arange(1, 100):
        joints = JointSample(time, np.full(6, SPEED * (time - late)), np.full(6, SPEED), np.zeros(6), True)
        memory.passed.theta[:] = SPEED * (time + AHEAD - late)
        learning.motors.plan.append(memory.plan, time + AHEAD, memory.passed.all)
        learning.hear(memory, time, (joints, PoseSample(time - PERIOD, RigidTransform(), True)), np.inf)
        learning.learn(memory)
    assert len(found) >= 94
    stamps, motors = np.array(found).T
    np.testing.assert_allclose(motors, SPEED * stamps, atol=1e-9)

"""A command that is worked out before its message is the one that is worked out after it, whatever comes."""

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.common.value import Value

from diagrams.scenario.scenario import load_scenario
from robots.description.model import load_robot
from systems.controller_model import ControllerModel
from systems.guard.guard import GuardConfig
from systems.reference.path_time import PathTime
from systems.reference.paths import make_path
from systems.reference.reference import PathAhead
from systems.samples import JointSample, PoseSample
from systems.servo.self_calibrating.config import SelfCalibratingConfig
from systems.servo.self_calibrating.law import SelfCalibrating

PERIOD = 4e-3
STOPPED, SLOWED, LOST = range(60, 65), 110, (150, 151)  # ticks
START = np.array([0.1, 0.3, 0.2, 0.1, 0.9, 0.0])  # rad


@pytest.fixture(scope="module")
def law() -> SelfCalibrating:
    robot = load_robot("irb1200")
    return SelfCalibrating(ControllerModel(robot, period=PERIOD), SelfCalibratingConfig(), GuardConfig())


def commands(law: SelfCalibrating, asks: bool) -> np.ndarray:
    """Of every tick: the robot is stopped and started again, the path is slowed, messages are lost."""
    ahead = PathAhead(make_path(load_scenario("misaligned").reference), PERIOD, time=PathTime(0.5))
    context = law.CreateDefaultContext()
    ports = {
        name: law.GetInputPort(name).FixValue(context, value)
        for name, value in (
            ("reference", Value[object](ahead)),
            ("joint_sample", Value(JointSample())),
            ("pose_sample", Value(PoseSample())),
        )
    }
    rows = []
    for k in range(200):
        if k in LOST:
            continue
        time = k * PERIOD
        context.SetTime(time)
        sample = JointSample(time, START + 1e-3 * np.sin(time), running=k not in STOPPED)
        ports["joint_sample"].GetMutableData().set_value(sample)
        if k == SLOWED:
            assert ahead.time is not None
            ahead = replace(ahead, time=ahead.time.changed(time - 0.5, time - 0.5, 0.3))
            ports["reference"].GetMutableData().set_value(ahead)
        context.SetDiscreteState(law.EvalUniquePeriodicDiscreteUpdate(context))
        if asks:
            law.learn(context)
        outputs = "position_command", "velocity_command", "torque_feedforward", "look_ahead"
        rows.append(np.concatenate([law.GetOutputPort(name).Eval(context) for name in outputs]))
    return np.array(rows)


def test_it_is_the_same_whatever_comes(law):
    before, after = commands(law, asks=True), commands(law, asks=False)
    assert np.ptp(after[STOPPED.stop :, :6], axis=0).min() > 1e-3
    assert np.array_equal(before, after)


def arrays(memory: SimpleNamespace, of: str = "") -> Iterator[tuple[str, np.ndarray]]:
    for name, part in vars(memory).items():
        if isinstance(part, SimpleNamespace):
            yield from arrays(part, f"{of}{name}.")
        elif name != "all":
            yield of + name, part


@pytest.mark.slow
def test_a_command_that_is_taken_back_leaves_no_trace(law):
    """The robot hangs in friction where a path begins that it hardly knows."""
    path = make_path(replace(load_scenario("misaligned").reference, settle=0.4))
    law.prepare(path, START)
    ahead, context = PathAhead(path, PERIOD, time=PathTime(0.5)), law.CreateDefaultContext()
    ports = {"reference": Value[object](ahead), "pose_sample": Value(PoseSample())}
    for name, value in ports.items():
        law.GetInputPort(name).FixValue(context, value)
    joints = law.GetInputPort("joint_sample").FixValue(context, Value(JointSample()))
    moved = set()
    for k in range(150):
        context.SetTime(k * PERIOD)
        joints.GetMutableData().set_value(JointSample(k * PERIOD, START, running=True))
        context.SetDiscreteState(law.EvalUniquePeriodicDiscreteUpdate(context))
        vector = context.get_mutable_discrete_state(law._memory).get_mutable_value()
        memory = law._layout.view(vector)
        law._learning.learn(memory)
        memory.heard.accepted[0] = k * PERIOD  # as if the camera went on showing something
        before = {name: array.copy() for name, array in arrays(memory)}
        law.learn(context)
        moved |= {name for name, array in arrays(memory) if not np.array_equal(array, before[name])}
        law._next.take_back(memory)
        left = [name for name, array in arrays(memory) if not np.array_equal(array, before[name], True)]
        assert [name for name in left if not name.startswith("next.")] == [], k
    assert {"drives.wound", "by_knowledge", "planner.q"} <= moved


def test_a_path_begins_when_its_own_time_says_so(law):
    """Held before its begin for 0.3 s, as where the probe begins anew, it begins so much later."""
    path = make_path(replace(load_scenario("misaligned").reference, settle=0.4))
    held = PathTime(0.05).changed(0.0, 0.1, 0.0).changed(0.0, 0.4, 1.0)
    ahead, context = PathAhead(path, PERIOD, time=held), law.CreateDefaultContext()
    still = JointSample(0.0, START, running=True)
    for name, value in {"reference": ahead, "joint_sample": still, "pose_sample": PoseSample()}.items():
        law.GetInputPort(name).FixValue(context, Value[object](ahead) if value is ahead else Value(value))
    begins = []
    for k in range(200):
        context.SetTime(k * PERIOD)
        context.SetDiscreteState(law.EvalUniquePeriodicDiscreteUpdate(context))
        memory = law.memory(context)
        begins += [float(memory.planned[0])] * int(memory.next.begins_path[0])
    assert begins == [pytest.approx(0.7, abs=PERIOD)]

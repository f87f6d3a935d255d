"""A tool that is knocked out of its place while a robot moves that is not known well."""

import math
import re

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from diagrams.runs.real_time import RealTimeRun
from diagrams.scenario.scenario import load_scenario
from diagrams.tool_watch import DISPLACED, ToolWatch
from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics
from systems.guard.config import GuardConfig
from systems.link.abb.messages import decode_report
from systems.samples import PoseSample
from tests.diagrams.lockstep import Lockstep
from tests.robots.programs.written import with_random_errors
from tests.systems.link.abb.reports import report as reported

ROBOT = load_robot("irb1200")
PERIOD, DELAY, SIGMA = 0.004, 0.012, 50e-6  # s, s, m
AT = 5.0  # s


def events(seed: int, shift: np.ndarray, blind: tuple[float, float] = (0.0, 0.0)) -> list[tuple[float, str]]:
    """Times at which something was said, and what, along a motion of 9 s in which all joints swing."""
    rng = np.random.default_rng(seed)
    true, watch = Kinematics(with_random_errors(ROBOT, seed)), ToolWatch(ROBOT)
    swing, phase, rate = rng.uniform(0.1, 0.5, 6), rng.uniform(0, 6, 6), rng.uniform(0.5, 1.5, 6)

    def joints(t: float) -> np.ndarray:
        return np.array([0.2, 0.4, -0.2, 0.3, 0.7, 0.1]) + swing * np.sin(rate * t + phase)

    sample, found = PoseSample(), []
    for tick in range(round(9.0 / PERIOD)):
        time = tick * PERIOD
        exposed = time - DELAY - 0.3 * PERIOD  # between two ticks
        if not blind[0] <= exposed < blind[1]:
            X = true.forward(joints(exposed)[None])[0]
            p = X[:3, 3] + SIGMA * rng.standard_normal(3) + (X[:3, :3] @ shift if exposed >= AT else 0.0)
            sample = PoseSample(exposed, RigidTransform(p), True)
        said = watch.note(time, joints(time), sample)
        if said is not None:
            assert said[0] == DISPLACED
            found.append((time, said[1]))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_fifth_of_a_millimetre_is_named_within_a_second_of_motion(seed: int):
    """The robot is off by millimetres; its size is known to its standard deviation."""
    ((time, said),) = events(seed, np.array([0.0, 1.6e-4, -1.2e-4]))
    assert AT < time <= AT + 1.0
    match = re.match(r"since (\S+) s by (\S+) mm, standard deviation (\S+):", said)
    assert match is not None
    since, size, sigma = map(float, match.groups())
    assert since == pytest.approx(AT, abs=0.05)
    assert abs(size - 0.2) < 5.0 * sigma


@pytest.mark.slow
def test_nothing_is_named_without_it_though_the_camera_sees_nothing_for_a_while():
    assert events(4, np.zeros(3), blind=(3.0, 3.6)) == []


@pytest.mark.slow
def test_a_guided_run_says_so_while_it_goes_on():
    scenario = load_scenario(
        "cell",
        [
            *("reference.path=circle", "reference.acceleration=1.2", "station.elasticity=rigid"),
            *("reference.settle=0.5", "reference.dwell=0.5", "initial_error_mm=[0, 0, 0]"),
            "station.events=[!ToolShift {at: 3, shift_mm: [0.2, 0, 0]}]",
        ],
    )
    wire = Lockstep(scenario)
    record = RealTimeRun(scenario, "open_loop").run(wire.link, wire.camera(), now=wire.now)
    (event,) = [each for each in record.log.guard_events if each.kind == DISPLACED]
    since = float(event.detail.split()[1])
    assert 0.0 < event.time - since <= 1.0


@pytest.mark.parametrize(
    ("scale", "turn_deg", "shift", "is_refused"),
    [
        (1.0, 30.0, 0.15, False),  # a station that is not aligned well, as the guard allows it
        (1.0, 0.0, 0.25, True),  # a camera's frame that is another one
        (1.0, 50.0, 0.0, True),
        (math.pi / 180.0, 0.0, 0.0, True),  # joints in rad, read as degrees
    ],
)
def test_a_robot_is_not_moved_whose_joints_and_camera_contradict_each_other(
    scale: float, turn_deg: float, shift: float, is_refused: bool
):
    joints = np.deg2rad([0.0, 20.0, 0.0, 0.0, 60.0, 0.0])
    X_true = RigidTransform(Kinematics(ROBOT).forward(joints))
    moved = RigidTransform(RotationMatrix.MakeZRotation(math.radians(turn_deg)), [shift, 0.0, 0.0])
    report = decode_report(reported(1, scale * joints))
    why = ToolWatch(ROBOT).contradiction(report, PoseSample(0.0, X_true @ moved, True), GuardConfig())
    assert bool(why) == is_refused
    if is_refused:
        assert why.startswith("the camera sees the tool ")

"""The separation monitor in a diagram: somebody walks up, images stop, and a restart is acknowledged."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator

from robots.description.model import load_robot
from robots.kinematics.arm_capsules import ArmCapsules
from systems.guard.separation.protective_distance import (
    ReactionTime,
    SeparationConfig,
    protective_distance,
)
from systems.guard.separation.separation_monitor import STATUS, SeparationMonitor
from systems.samples import JointSample, Person, PersonSample

ROBOT = load_robot("irb1200")
ARM = ArmCapsules(ROBOT)
REACTION = ReactionTime(images=0.05, transport=0.03, computation=0.05, decision=0.02, command=0.01)
CONFIG = SeparationConfig(acknowledge=False)
SPEED = np.array([1.0, 0.5, 0.0, 0.0, 0.0, 0.0])
HOME, NEVER = np.zeros(6), np.inf


class Walk:
    """A monitor whose inputs are set step by step: a person on the x axis, a path run with the share."""

    def __init__(self, config: SeparationConfig = CONFIG) -> None:
        self.monitor = SeparationMonitor(ROBOT, ARM, config, REACTION, 0.25)
        self.simulator = Simulator(self.monitor)
        self.context = self.simulator.get_mutable_context()
        self.period = config.period

    def port(self, name: str) -> np.ndarray:
        return self.monitor.GetOutputPort(name).Eval(self.context)

    def step(
        self,
        x: float | None,
        trusted: bool = True,
        last: float = NEVER,
        acknowledge: bool = False,
        speed: np.ndarray = SPEED,
        q: np.ndarray = HOME,
    ):
        """One decision; images come until ``last``. Returns share, stop and status."""
        now = self.context.get_time()
        people = () if x is None else (Person(1, np.array([[x, 0.0, 0.4]]), 0.0, np.zeros(3)),)
        exposed = min(now, last) - 0.1
        share = float(self.port("speed_share")[0])
        for name, value in (
            ("person_sample", Value[object](PersonSample(exposed, trusted, people))),
            ("joint_sample", Value(JointSample(now, q))),
            ("velocity_command", share * speed),
            ("path_time", [now, share]),
            ("acknowledge", [float(acknowledge)]),
        ):
            self.monitor.GetInputPort(name).FixValue(self.context, value)
        self.simulator.AdvanceTo(now + self.period)
        status = dict(zip(STATUS, self.port("separation"), strict=True))
        return float(self.port("speed_share")[0]), bool(self.port("stop")[0]), status


def warmed_up(walk: Walk) -> Walk:
    for _ in range(150):
        share, stop, _ = walk.step(4.0)
    assert share == 1.0
    assert not stop
    return walk


def test_somebody_who_walks_up_slows_the_robot_and_stops_it_before_it_is_too_near():
    walk, shares = warmed_up(Walk()), []
    for x in np.arange(4.0, 0.5, -1.6 * CONFIG.period):
        share, stop, status = walk.step(x)
        shares.append(share)
        terms = walk.monitor.terms(share * SPEED, np.zeros(6))
        assert stop or status["distance"] >= terms.total - 1e-9  # always enough for the speed that is allowed
        if status["distance"] < terms.at_rest:
            assert stop
    assert np.all(np.diff(shares) <= 1e-12)
    assert shares[0] == 1.0
    assert shares[-1] == 0.0
    assert any(0.2 < share < 0.8 for share in shares)


@pytest.mark.parametrize("turns", [1.0, -1.0])
def test_joints_count_with_their_signs_whether_they_turn_with_each_other_or_against(turns):
    """With axis 4 turned round, the hand is the faster for what axis 5 does if it turns against axis 3."""
    walk, q, speed = Walk(), np.array([0.0, 0.0, 0.0, np.pi, 0.0, 0.0]), np.array([0, 0, 1.0, 0, turns, 0])
    for _ in range(300):
        share, _, status = walk.step(6.0, q=q, speed=speed)
    assert share == 1.0
    now, later = ARM.at(q), ARM.at(q + 1e-4 * speed)
    ends = np.concatenate([later.start - now.start, later.end - now.end])
    fastest = np.linalg.norm(ends, axis=1).max() / 1e-4
    least = protective_distance(CONFIG, REACTION, fastest, 0.25, CONFIG.human_speed).total
    assert status["protective_distance"] >= least - 1e-9


def test_without_images_it_slows_and_then_stops():
    walk = warmed_up(Walk())
    last = walk.context.get_time()
    ages, shares = [], []
    while not (result := walk.step(4.0, last=last))[1]:
        ages.append(result[2]["age"])
        shares.append(result[0])
    assert result[2]["age"] == pytest.approx(CONFIG.stop_after, abs=1.5 * CONFIG.period)
    slow = np.array(ages) > CONFIG.slow_after + 1e-9
    np.testing.assert_array_equal(np.array(shares)[~slow], 1.0)
    assert np.all(np.diff(np.array(shares)[slow]) <= 0.0)
    assert shares[-1] < 0.1


def test_images_that_are_not_trusted_are_as_good_as_none():
    walk = warmed_up(Walk())
    results = [walk.step(4.0, trusted=False) for _ in range(40)]
    assert results[-1][1]
    assert results[-1][0] == 0.0


def test_a_stop_ends_only_when_somebody_says_so():
    walk = warmed_up(Walk(replace(CONFIG, acknowledge=True)))
    assert walk.step(0.5)[1]
    assert all(walk.step(4.0)[1] for _ in range(50))  # gone, but nobody has said so
    assert walk.step(0.5, acknowledge=True)[1]  # somebody has, but it is too near
    share, stop, _ = walk.step(4.0, acknowledge=True)
    assert not stop
    assert share <= CONFIG.rise * CONFIG.period  # and it begins slowly
    assert not walk.step(4.0)[1]


def test_before_the_first_images_it_does_not_move():
    assert Walk().step(None, last=-NEVER)[0] == 0.0


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"slow_after": 0.7}, "slow_after=0.7 s must be below stop_after=0.6 s"),
        ({"slow_after": 0.1}, "slow_after=0.1 s must be above the 0.13 s"),
    ],
)
def test_times_that_contradict_each_other_are_refused(change, says):
    with pytest.raises(ValueError, match=says):
        SeparationMonitor(ROBOT, ARM, replace(CONFIG, **change), REACTION, 0.25)

"""The watch in the finished diagram: its latency, somebody who walks up, and the path that is kept."""

from functools import cache

import numpy as np
import pytest

from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario
from diagrams.watching import Watch, make_watch
from robots.description.model import load_robot
from robots.pose import pose_error
from systems.cell.overview.person import gap
from systems.guard.separation.separation_monitor import STATUS
from tests.systems.vision.people.rigs import Painted

COARSE = ["station.overview.width=320", "servo.people.hull.edge=0.1"]
ROBOT = load_robot("irb1200")


@cache
def experiment(*settings: str) -> tuple[Experiment, Watch]:
    scenario = load_scenario("watched", [*COARSE, *settings])
    watch = make_watch(scenario, ROBOT, pictures=Painted())
    return Experiment(scenario, "open_loop", watch=watch), watch


@pytest.mark.slow
def test_a_decision_knows_images_that_are_as_old_as_the_parts_of_the_chain_say():
    watched, watch = experiment()
    watched.advance(until=1.2)
    times, data = watched.watched()
    age = data["separation"][times > 0.5, STATUS.index("age")]
    reaction = watch.cell.reaction
    youngest = reaction.transport + reaction.computation
    assert youngest - 1e-9 <= age.min() <= youngest + reaction.decision + 1e-9
    assert age.max() <= youngest + reaction.images + reaction.decision + 1e-9


@pytest.mark.slow
def test_the_robot_rests_while_somebody_is_near_and_never_leaves_its_path():
    (near, watch), (alone, _) = experiment(), experiment("station.overview.people=[]")
    for each in (near, alone):
        each.advance()
    times, data = near.watched()
    person = watch.cell.people[0]
    arm, gaps = watch.cell.detector.arm, []
    for time, state in zip(times[::25], data["truth.motor_state"][::25], strict=True):
        figure = person.at(time)
        gaps.append(np.inf if figure is None else gap(figure, arm.at(state[:6])))
    rate = data["path_time"][::25, 1]
    # While it comes nearer than a robot at rest needs, at 1.2 m/s, the chain reacts and the path is slowed.
    at_rest = watch.monitor.terms(np.zeros(6), np.zeros(6)).at_rest
    is_near = np.array(gaps) < at_rest - 1.2 * (watch.cell.reaction.total + near.scenario.reference.slowing)
    assert is_near.any()
    assert np.abs(rate[is_near]).max() < 1e-6
    assert data["stop"].any()
    assert data["stop"][-1] == 0.0
    assert data["path_time"][-1, 0] >= near.path.dwell_start  # it went on by itself and came to the end
    worst = [
        np.abs(pose_error(log.X_WE_desired, log.X_WE_true))[:, 3:].max() for log in (near.log(), alone.log())
    ]
    assert worst[0] <= 1.01 * worst[1]
    assert not alone.watched()[1]["stop"].any()

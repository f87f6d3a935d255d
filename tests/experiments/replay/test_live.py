"""Watching a run does not change it."""

import numpy as np

from diagrams.runs.simulation import Experiment, run
from diagrams.scenario.scenario import load_scenario
from experiments.replay.live import LiveView, advance_live
from robots.description.model import load_robot
from tests.experiments.test_compare import SETTINGS, same


def test_a_run_that_is_watched_is_the_same_bit_for_bit():
    scenario, robot = load_scenario("misaligned", SETTINGS), load_robot("irb1200")
    experiment = Experiment(scenario, "numerical_ik", robot)
    view = LiveView(experiment, robot, port=0)
    shares: list[float] = []
    advance_live(experiment, view, shares.append)
    watched, alone = experiment.log(), run(scenario, "numerical_ik", robot)
    assert np.array_equal(watched.time, alone.time)
    assert same(watched, alone)
    assert view.address.startswith("http://localhost:")
    # 30 frames per second of the 1.8 s.
    assert len(shares) == np.ceil(1.8 / 0.032)
    assert shares[-1] == 1.0

"""The laws of comparison do what they promise: less error from lap to lap, and a disturbance made up for."""

import numpy as np
import pytest

from diagrams.runs.simulation import Experiment
from experiments.metrics.laps import lap_metrics
from experiments.metrics.run_metrics import pose_errors
from systems.reference.paths import ReferenceConfig, make_path
from systems.servo import LAWS
from tests.diagrams.rigs import QUIET, scenario

SHORT = ["reference.path=circle", "reference.acceleration=3", "reference.dwell=0.6", *QUIET]
RIGID = ["station.elasticity=rigid", "station.payload=0"]


def laps_mm(law: str, laps: int, *settings: str) -> list[float]:
    experiment = Experiment(scenario("misaligned", *SHORT, *RIGID, f"reference.laps={laps}", *settings), law)
    experiment.advance()
    log = experiment.log()
    return [lap["max_norm_mm"] for lap in lap_metrics(log, pose_errors(log, "true"))]


@pytest.mark.slow
def test_iterative_learning_gains_from_every_lap():
    first, second, third = laps_mm("iterative_learning", 3, "reference.settle=1.5")
    assert second < 0.5 * first
    assert third < 0.5 * second


def test_iterative_learning_refuses_a_lap_that_it_cannot_remember():
    law = LAWS["iterative_learning"]
    with pytest.raises(ValueError, match=r"a lap may take 20 s, got"):
        law.check_path(
            Experiment(scenario("misaligned"), "iterative_learning").servo.law,
            make_path(ReferenceConfig(acceleration=0.05)),
        )


def test_a_disturbance_observer_forgets_a_constant_disturbance_with_its_time_constant():
    """At rest the error falls by e in 1 / 15 s; delays and the filter of the drives make that slower."""
    settings = [*SHORT, *RIGID, "reference.settle=20"]
    experiment = Experiment(scenario("misaligned", *settings), "disturbance_observer")
    experiment.advance(1.0)
    log = experiment.log()
    distance = np.linalg.norm(pose_errors(log, "true")[:, 3:], axis=1)
    assert distance[0] > 10e-3
    assert distance[log.time > 0.8].max() < 0.01 * distance[0]

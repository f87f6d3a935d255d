"""What a law's updates cost is taken without changing what the law does."""

import numpy as np

from diagrams.runs.simulation import Experiment
from diagrams.servo import Servo
from robots.description.model import load_robot
from systems.servo.numerical_ik import NumericalIk
from tests.diagrams.rigs import scenario
from tests.systems.rigs import PERIOD


def test_every_update_of_a_law_is_timed():
    experiment = Experiment(scenario("misaligned", "station.elasticity=rigid"), "numerical_ik")
    experiment.advance(0.1)
    log = experiment.log()
    assert len(log.tick_seconds) in (round(0.1 / PERIOD), round(0.1 / PERIOD) + 1)
    assert 0.0 < np.sum(log.tick_seconds) < log.wall_time
    assert log.learnt is None


def test_a_timed_law_is_still_itself():
    law = Servo(load_robot("irb1200"), scenario("misaligned"), "numerical_ik").law
    assert isinstance(law, NumericalIk)
    assert type(law).__name__ == "NumericalIk"


class Learner(NumericalIk):
    """A law that says what it has learnt."""

    def learnt(self, context) -> dict[str, float]:
        return {"mass_kg": 7.0, "until_s": context.get_time()}


def test_what_a_law_has_learnt_is_in_its_log():
    experiment = Experiment(scenario("misaligned", "station.elasticity=rigid"), Learner)
    experiment.advance(0.02)
    assert experiment.log().learnt == {"mass_kg": 7.0, "until_s": 0.02}

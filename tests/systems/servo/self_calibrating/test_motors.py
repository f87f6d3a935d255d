"""What the self-calibrating law learns of motors: a change in operation opens what it believes of them."""

import numpy as np
import pytest

from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario
from robots.description.model import load_robot
from systems.controller_model import ControllerModel
from systems.estimation.drives.drive_model import MASS
from systems.estimation.memory import Layout
from systems.servo.self_calibrating.config import SelfCalibratingConfig
from systems.servo.self_calibrating.law import SelfCalibrating
from systems.servo.self_calibrating.learning import Learning
from tests.diagrams.rigs import QUIET

PERIOD = 4e-3
FAR = np.full(6, 1e-2)  # rad, further behind the plan than drives get on their own


def test_what_is_believed_is_opened_once_by_a_change_that_lasts():
    model = ControllerModel(load_robot("irb1200"), 7.0, PERIOD, elasticity="structure", takes_torque=True)
    learning = Learning(model, SelfCalibratingConfig())
    layout = Layout(**learning.arrays)
    memory = layout.view(np.zeros(layout.size))
    learning.start(memory)
    variance = []
    for k in range(round(0.9 / PERIOD)):
        learning.motors._learn_drives(memory, 1.0 + k * PERIOD, FAR)
        variance.append(memory.drives.P[MASS, MASS])
    steps = np.diff(variance)
    assert np.count_nonzero(steps > 1.0) == 1  # kg^2; motors that stand show nothing of the mass
    assert variance[-1] > 10.0 * variance[0]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "looks"), [("none", False), ("smooth", True)])
def test_gains_are_looked_for_where_a_probe_shows_them_alone(kind: str, looks: bool):
    """Without one nothing ever asks for what would be summed up at every tick, to the end of the run."""
    settings = [
        f"servo.laws.self_calibrating.probe.kind={kind}",
        "station.elasticity=rigid",
        "reference.settle=4",
    ]
    experiment = Experiment(load_scenario("nominal", [*QUIET, *settings]), "self_calibrating")
    experiment.advance(2.0)
    law = experiment.servo.law
    assert isinstance(law, SelfCalibrating)
    memory = law.memory(law.GetMyContextFromRoot(experiment.context))
    assert (memory.gains.search.samples[0] > 100.0) == looks

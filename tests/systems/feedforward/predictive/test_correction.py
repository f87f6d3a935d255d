"""The predictive correction on its own: motors that friction holds back, samples that do not come, bounds."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantVectorSource

from experiments.feedforward.rectangle import working_position
from robots.description.model import NUM_JOINTS, load_robot
from robots.kinematics.forward import Kinematics
from robots.pose import zyx_from_rotation
from systems.controller_model import ControllerModel
from systems.feedforward.predictive.config import PredictiveConfig
from systems.feedforward.predictive.correction import PredictiveCorrection
from systems.reference.paths import ReferenceConfig
from systems.reference.reference import Reference
from systems.reference.shapes import Rectangle, Waypoint
from systems.samples import JointSample

ROBOT, PERIOD, BEHIND = load_robot("kr16"), 4e-3, 2e-4  # rad
HOME = working_position(ROBOT)
CONFIG = PredictiveConfig("motors")
LIMIT = CONFIG.limit * ROBOT.joint_coulomb_friction


class Encoders(LeafSystem):
    """Motors that stand a little behind their commands, and samples of them until they get lost."""

    def __init__(self, behind: float, lost_from: float) -> None:
        super().__init__()
        self._behind, self._lost_from = behind, lost_from
        self.DeclareAbstractOutputPort("joint_sample", lambda: Value(JointSample()), self._calc)

    def _calc(self, context: Context, output) -> None:
        time = min(context.get_time(), self._lost_from)
        output.set_value(JointSample(time, HOME - self._behind, running=True))


def torques(behind: float, lost_from: float = np.inf, end: float = 0.2) -> np.ndarray:
    """Of a robot that shall stand still, at the ticks, (n, 6)."""
    X_WE = Kinematics(ROBOT).forward(HOME)
    place = Waypoint(1e3 * X_WE[:3, 3], np.rad2deg(zyx_from_rotation(X_WE[:3, :3])))
    beside = replace(place, translation_mm=np.array(place.translation_mm) + np.array([0.0, 10.0, 0.0]))
    builder = DiagramBuilder()
    still = ReferenceConfig(Rectangle([place, beside]), settle=1.0, preview=PERIOD)
    reference = builder.AddSystem(Reference(still, PERIOD))
    model = ControllerModel(ROBOT, 16.0, PERIOD, preview=PERIOD, command_delay=PERIOD)
    correction = builder.AddSystem(PredictiveCorrection(model, CONFIG))
    sources = {
        "reference": reference.GetOutputPort("reference"),
        "joint_sample": builder.AddSystem(Encoders(behind, lost_from)).get_output_port(),
        "position_command": builder.AddSystem(ConstantVectorSource(HOME)).get_output_port(),
        "velocity_command": builder.AddSystem(ConstantVectorSource(np.zeros(NUM_JOINTS))).get_output_port(),
    }
    for name, source in sources.items():
        builder.Connect(source, correction.GetInputPort(name))
    simulator = Simulator(builder.Build())
    port, rows = correction.GetOutputPort("torque"), []
    own = correction.GetMyContextFromRoot(simulator.get_context())
    for time in PERIOD * np.arange(1, round(end / PERIOD)):
        simulator.AdvanceTo(time - 0.5 * PERIOD)
        rows.append(port.Eval(own))
    return np.array(rows)


def test_motors_that_are_behind_are_pushed_on_within_the_bounds():
    pushed = torques(BEHIND)
    assert (pushed[-1] > 0.0).all()
    assert (np.abs(pushed) <= LIMIT + 1e-9).all()
    assert torques(20.0 * BEHIND).max(axis=0) == pytest.approx(LIMIT), "and no more if they are far behind"


def test_motors_on_their_commands_are_left_alone():
    assert torques(0.0) == pytest.approx(0.0, abs=1e-3 * LIMIT.min())


def test_motors_far_from_their_commands_are_left_to_the_drives():
    assert np.array_equal(torques(0.1), np.zeros_like(torques(0.1)))


def test_without_samples_the_correction_fades():
    """From the first tick without one it loses a fifth at each."""
    lost = 0.1
    found = torques(BEHIND, lost_from=lost)
    gone = found[round(lost / PERIOD) + 1 :]
    assert np.abs(gone[0]).min() > 0.0
    assert gone[1:] == pytest.approx(0.8 * gone[:-1])
    assert np.abs(gone[-1]).max() < 0.1 * np.abs(gone[0]).max()


def test_the_same_samples_give_the_same_torques():
    assert np.array_equal(torques(BEHIND), torques(BEHIND))

"""What is left at the end of a line: motors are corrected by what encoders see, tips by what is believed."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem, State

from diagrams import servo
from diagrams.scenario.scenario import ScenarioError
from experiments.feedforward.identified_beliefs import believed
from experiments.feedforward.line_end import LineEnd, line_end, line_scenario, trial, trials
from robots.description.drive_parts import Backlash
from robots.description.model import RobotModel, load_robot
from systems.controller_model import ControllerModel
from systems.feedforward.predictive.config import PredictiveConfig
from systems.feedforward.predictive.correction import PredictiveCorrection
from systems.samples import JointSample

AWAY, ACROSS = 0, 1  # edges: the one away from the robot, and across
ALONE, CORRECTED = 0, 1


@cache
def found(name: str, which: int, plant: str | None = None) -> LineEnd:
    of = trials(name, plant)[which]
    return line_end(of, line_scenario(of, ACROSS))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["kr16", "kr210"])
def test_on_a_realistic_robot_motors_come_to_rest_twice_as_near(name: str):
    """And the tip does not come to rest worse, of which a camera alone would see the rest."""
    alone, corrected = found(name, ALONE), found(name, CORRECTED)
    assert corrected.motors.effective < 0.5 * alone.motors.effective
    assert corrected.motors.largest < 0.5 * alone.motors.largest
    assert corrected.tip.effective < 0.75 * alone.tip.effective


@pytest.mark.slow
def test_a_robot_that_is_as_believed_is_left_alone():
    """Some micrometres come of what the six programs leave out: that joints drag each other along."""
    alone, corrected = found("kr16", ALONE, "kr16"), found("kr16", CORRECTED, "kr16")
    assert corrected.tip.largest == pytest.approx(alone.tip.largest, abs=1.2e-5)  # m
    assert corrected.motors.largest == pytest.approx(alone.motors.largest, abs=1.2e-5)


class LosesSamples(LeafSystem):
    """A line on which a third of the samples is lost: there the last one that came stands still."""

    def __init__(self, period: float) -> None:
        super().__init__()
        self._sent = self.DeclareAbstractInputPort("sent", Value(JointSample()))
        self._last = self.DeclareAbstractState(Value(JointSample()))
        self.DeclareAbstractOutputPort("received", lambda: Value(JointSample()), self._calc)
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._keep)

    def _received(self, context: Context) -> JointSample:
        lost = np.random.default_rng(round(1e6 * context.get_time())).random() < 1.0 / 3.0
        return context.get_abstract_state(int(self._last)).get_value() if lost else self._sent.Eval(context)

    def _calc(self, context: Context, output: AbstractValue) -> None:
        output.set_value(self._received(context))

    def _keep(self, context: Context, state: State) -> None:
        state.get_mutable_abstract_state(int(self._last)).set_value(self._received(context))


def behind_a_lossy_line(model: ControllerModel, config: PredictiveConfig) -> Diagram:
    """The correction of the motors, with samples that get lost on the way to it."""
    builder = DiagramBuilder()
    line = builder.AddSystem(LosesSamples(model.period))
    correction = builder.AddSystem(PredictiveCorrection(model, config))
    builder.Connect(line.GetOutputPort("received"), correction.GetInputPort("joint_sample"))
    builder.ExportInput(line.GetInputPort("sent"), "joint_sample")
    for name in ("reference", "position_command", "velocity_command"):
        builder.ExportInput(correction.GetInputPort(name), name)
    builder.ExportOutput(correction.GetOutputPort("torque"), "torque")
    return builder.Build()


@pytest.mark.slow
def test_with_a_third_of_the_samples_lost_hardly_more_is_left_than_uncorrected(
    monkeypatch: pytest.MonkeyPatch,
):
    """By a twentieth, for the arm rings a little otherwise."""
    monkeypatch.setattr(servo, "PredictiveCorrection", behind_a_lossy_line)
    lossy_trial = trials("kr16")[CORRECTED]
    lossy, alone = line_end(lossy_trial, line_scenario(lossy_trial, ACROSS)), found("kr16", ALONE)
    assert lossy.motors.effective < 1.05 * alone.motors.effective
    assert lossy.tip.effective < 1.05 * alone.tip.effective


def across(believed: RobotModel, true: RobotModel, kind: str, predictive: str = "none") -> LineEnd:
    of = trial(believed, true, kind, predictive)
    return line_end(of, line_scenario(of, ACROSS))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["kr16", "kr210"])
def test_with_what_an_identification_finds_the_tip_comes_to_rest_twice_as_near(name: str):
    true = load_robot(f"{name}-realistic")
    belief = believed(true, 1)
    alone, corrected = across(belief, true, "elastic_structure"), across(belief, true, "corrected", "motors")
    assert corrected.tip.largest < 0.5 * alone.tip.largest
    assert corrected.tip.effective < 0.5 * alone.tip.effective


@pytest.mark.slow
def test_where_axis_1_may_rest_anywhere_in_its_play_no_more_is_left_than_uncorrected():
    """Away from the robot, with half the load: there a correction for one place alone makes it swing more."""
    true = load_robot("kr210-realistic")
    belief = believed(true, 3)
    half = [
        trial(belief, true, kind, beside, share=0.5)
        for kind, beside in (("elastic_structure", "none"), ("corrected", "motors"))
    ]
    alone, corrected = (line_end(each, line_scenario(each, AWAY)) for each in half)
    assert corrected.tip.largest < alone.tip.largest
    assert corrected.tip.effective < alone.tip.effective


@pytest.mark.slow
@pytest.mark.parametrize("edge", [AWAY, 2])
def test_where_a_camera_sees_axis_1_rest_half_is_left_of_what_is_left_uncorrected(edge: int):
    """Lines on which it hardly moves: there it matters most where in its play it begins."""
    true = load_robot("kr210-realistic")
    belief = believed(true, 1)
    both = (
        trial(belief, true, "elastic_structure", "none"),
        trial(belief, true, "corrected", "motors", resting="seen"),
    )
    alone, seen = (line_end(each, line_scenario(each, edge)) for each in both)
    assert seen.tip.effective < 0.5 * alone.tip.effective
    assert seen.tip.largest < 0.5 * alone.tip.largest


@pytest.mark.slow
def test_a_camera_that_sees_nothing_before_the_run_is_named():
    true = load_robot("kr16-realistic")
    of = trial(true, true, "corrected", "motors", resting="seen")
    scenario = line_scenario(of, ACROSS)
    scenario.station.camera.dropouts = [[0.0, 10.0]]
    with pytest.raises(ScenarioError, match=r"feedforward\.resting=seen: .*the camera saw the tool at none"):
        line_end(of, scenario)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["kr16", "kr16-realistic"])
def test_of_a_robot_that_is_as_believed_the_corrected_inverse_leaves_no_more(name: str):
    """Some micrometres beside: those of the forward model and of commands that are told every 4 ms."""
    robot = load_robot(name)
    alone, corrected = (across(robot, robot, kind) for kind in ("elastic_structure", "corrected"))
    assert corrected.tip.largest < alone.tip.largest + 5e-6  # m
    assert corrected.tip.effective < alone.tip.effective + 5e-6


@pytest.mark.slow
def test_where_twice_the_play_is_believed_no_more_is_left_than_uncorrected():
    """Of the same belief: the rest of it is right."""
    true = load_robot("kr210-realistic")
    joints = []
    for joint in true.joints:
        train = joint.drive_train
        assert isinstance(train.backlash, Backlash)
        loose = replace(train.backlash, arc_minutes=2.0 * train.backlash.arc_minutes)
        joints.append(replace(joint, drive_train=replace(train, backlash=loose)))
    belief = replace(true, joints=joints)
    alone, corrected = across(belief, true, "elastic_structure"), across(belief, true, "corrected")
    assert corrected.tip.largest < alone.tip.largest
    assert corrected.tip.effective < alone.tip.effective


def test_drives_that_are_no_cascades_are_refused():
    of = trials("kr16")[CORRECTED]
    scenario = line_scenario(of, ACROSS)
    scenario.servo.laws["open_loop"].drive = "position"
    with pytest.raises(ScenarioError, match=r"predictive\.kind=motors corrects the torques .* drive=cascade"):
        line_end(of, scenario)

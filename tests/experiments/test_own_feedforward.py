"""An inverse model of one's own: a file, named where a shipped one is named."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.runs.simulation import Experiment, run
from diagrams.scenario.scenario import ScenarioError, load_scenario
from systems.feedforward import FEEDFORWARDS
from systems.named_classes import OwnClassError
from tests.experiments.commands import SHORT

SETTINGS = [setting.removeprefix("--set=") for setting in SHORT]
OWN = """
import numpy as np
from systems.feedforward.feedforward import Feedforward
from systems.feedforward.joint_motion import Drive

class Mine(Feedforward):
    title, colour = "mine", "#7a5195"

    def drive_under(self, reference, load, memory):
        torque = self.motor_torque(reference.velocity, reference.acceleration, load)
        return Drive(np.zeros(6), np.zeros(6), torque, memory)
"""


@pytest.mark.slow
def test_the_same_model_in_a_file_of_ones_own_does_the_same_bit_for_bit(tmp_path: Path):
    (tmp_path / "own.py").write_text(OWN)
    kinds = {"rigid": "rigid", "own": f"{tmp_path / 'own.py'}:Mine"}
    logs = {
        name: run(load_scenario("misaligned", [*SETTINGS, f"servo.feedforward.kind={kind}"]), "open_loop")
        for name, kind in kinds.items()
    }
    assert np.array_equal(logs["own"].position_command, logs["rigid"].position_command)
    assert np.array_equal(logs["own"].X_WE_true, logs["rigid"].X_WE_true)


def test_one_that_is_not_there_is_refused_in_one_line():
    with pytest.raises(
        ScenarioError, match=r"feedforward must be one of rigid, .* FILE\.py:CLASS, got 'magic'"
    ):
        load_scenario("misaligned", ["servo.feedforward.kind=magic"])


def test_one_that_computes_nothing_is_refused_before_anything_runs(tmp_path: Path):
    text = "from systems.feedforward.feedforward import Feedforward\nclass Mine(Feedforward): pass\n"
    (tmp_path / "own.py").write_text(text)
    kind = f"servo.feedforward.kind={tmp_path / 'own.py'}:Mine"
    with pytest.raises(ValueError, match="class Mine needs a method 'drive_under'"):
        run(load_scenario("misaligned", [*SETTINGS, kind]), "open_loop")


@pytest.mark.parametrize(
    ("right", "wrong", "why"),
    [
        ("Drive(np.zeros(6)", "Drive(np.zeros(5)", "must give 6 numbers as deflection, got 5"),
        ("return Drive", "Drive", "must return a Drive, got None"),
        ("Drive(np.zeros(6)", "Drive(np.full(6, np.nan)", "must give finite numbers as deflection, got"),
        ("torque, memory)", "np.array(list('abcdef')), memory)", "must give finite numbers as torque, got"),
    ],
)
def test_a_wrong_result_is_named(tmp_path: Path, right: str, wrong: str, why: str):
    (tmp_path / "own.py").write_text(OWN.replace(right, wrong))
    kind = f"servo.feedforward.kind={tmp_path / 'own.py'}:Mine"
    with pytest.raises(OwnClassError, match=f"Mine: drive_under {why}"):
        run(load_scenario("misaligned", [*SETTINGS, kind]), "open_loop")


@pytest.mark.parametrize("arguments", ["path, home", "path, home, standing=None", "*any"])
def test_one_may_prepare_itself_with_or_without_the_robot_that_was_looked_at(tmp_path: Path, arguments: str):
    prepare = f"    def prepare(self, {arguments}):\n        self.was_asked = True\n"
    (tmp_path / "own.py").write_text(OWN + prepare)
    kind = f"servo.feedforward.kind={tmp_path / 'own.py'}:Mine"
    experiment = Experiment(load_scenario("misaligned", [*SETTINGS, kind]), "open_loop")
    assert experiment.diagram.GetSubsystemByName("feedforward").was_asked


def test_a_class_that_is_none_is_refused_in_one_line(tmp_path: Path):
    (tmp_path / "own.py").write_text("class Mine:\n    pass\n")
    kind = f"servo.feedforward.kind={tmp_path / 'own.py'}:Mine"
    with pytest.raises(ScenarioError, match="class Mine must extend Feedforward"):
        Experiment(load_scenario("misaligned", [*SETTINGS, kind]), "open_loop")


def test_every_shipped_model_says_what_it_is():
    for name, model in FEEDFORWARDS.items():
        assert FEEDFORWARDS.name_of(model) == name
        assert model.title == name.replace("_", " ")
        assert model.colour.startswith("#")

"""The library gives what the commands give, refuses in one line, and leaves console and disk alone."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario
from experiments.identify.cases import default_cases
from experiments.identify.recording_map import Recording
from experiments.library import calibrate, compare, design, identify, record_motions, simulate
from experiments.metrics.run_metrics import error_metrics
from robots.calibration.error_model import ErrorModel
from robots.calibration.measurements import Measurements
from robots.description.model import load_robot
from robots.identification.motion import SensorPlace
from robots.identification.recording import RecordedCase
from systems.servo.pbvs import Pbvs
from tests.experiments.commands import SHORT, files


class InThisProcess:
    """An executor that does one job after the other, here."""

    def place(self, jobs: int) -> str:
        return "here"

    def completed(self, work, jobs, progress=None):
        for number, job in enumerate(jobs):
            yield number, work(job, lambda share: None)


SETTINGS = [setting.removeprefix("--set=") for setting in SHORT]


@pytest.mark.slow
def test_a_comparison_has_the_logs_of_single_runs_and_says_what_came_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    scenario = load_scenario("misaligned", SETTINGS)
    result = compare(scenario, ["open_loop", "pbvs"], executor=InThisProcess())
    alone = simulate(scenario, "open_loop")
    np.testing.assert_array_equal(result.logs["open_loop"][0].X_WE_true, alone.X_WE_true)
    largest = result.figure("max_norm_mm")
    assert largest["open_loop"] == pytest.approx(error_metrics(alone, "true")["max_norm_mm"], rel=1e-8)
    assert (result.best, result.judged_by) == ("pbvs", "true")
    assert "PBVS" in result.verdict
    assert files(tmp_path) == set()
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("laws", "cycles", "reason"),
    [(["pbvs", "pbvs"], 1, "laws that differ"), ([], 1, "laws that differ"), (["pbvs"], 0, "one cycle")],
)
def test_what_cannot_be_compared_is_refused(laws: list[str], cycles: int, reason: str):
    with pytest.raises(ValueError, match=reason):
        compare("misaligned", laws, cycles=cycles)


@pytest.mark.parametrize(("laws", "given"), [("pbvs", "'pbvs'"), ([Pbvs], "Pbvs")])
def test_laws_to_compare_are_a_list_of_names(laws: list[str], given: str):
    with pytest.raises(ValueError, match=rf"takes laws by name, \['pbvs'\] .*my_law.py:MyLaw.*{given}"):
        compare("misaligned", laws)


def test_a_law_that_does_not_exist_is_refused_before_anything_runs():
    with pytest.raises(ValueError, match="did you mean pbvs"):
        compare("misaligned", ["pbvz"])


@pytest.mark.parametrize("seed", [-1, 1.5, 2**32])
def test_a_seed_that_is_none_is_refused_in_one_line(seed: float):
    with pytest.raises(ValueError, match=f"seed must be a whole number between 0 and 4294967295, got {seed}"):
        simulate("misaligned", "open_loop", seed=seed)  # pyright: ignore[reportArgumentType]


def test_an_experiment_is_not_advanced_to_no_time():
    experiment = Experiment(load_scenario("nominal", SETTINGS), "open_loop")
    with pytest.raises(ValueError, match="cannot be advanced to nan s"):
        experiment.advance(until=float("nan"))


@pytest.mark.slow
def test_a_design_is_nearly_as_good_as_any():
    chosen = design("irb1200", count=12)
    assert chosen.configurations.shape == (12, 6)
    assert 0.9 * chosen.bound < chosen.b3 <= chosen.bound


@pytest.mark.slow
def test_a_robot_with_known_errors_is_found_and_tried_where_it_was_not_measured():
    robot = load_robot("irb1200")
    model, rng = ErrorModel(robot), np.random.default_rng(3)
    x = np.where([name.split("_")[-1].startswith("r") for name in model.names], 2e-3, 1e-3)
    x = x * rng.uniform(-1.0, 1.0, len(model))
    q, fresh = rng.uniform(-1.2, 1.2, (40, 6)), rng.uniform(-0.8, 0.8, (15, 6))
    tables = []
    for at in (q, fresh):
        X = model.forward(at, x)
        noise = 1e-5 * rng.standard_normal((len(at), 3))
        tables.append(Measurements(at, X[:, :3, 3] + noise, X[:, :3, :3]))
    found = calibrate("irb1200", *tables)
    assert found.before is not None
    assert found.after is not None
    assert found.before.mean_norm_mm > 1.0
    # The prediction has the noise of the measurements, 0.01 mm an axis, and that of what was found from them.
    assert found.after.mean_norm_mm < 0.05
    assert found.robot.is_calibrated
    assert found.robot.calibration.of == "irb1200"
    assert calibrate(robot, *tables).robot.calibration.of == "irb1200"  # as scenarios call it


@pytest.mark.parametrize("given", ["table.csv", np.zeros((20, 12))])
def test_measurements_of_another_kind_are_refused_in_one_line(given: Any):
    with pytest.raises(ValueError, match=r"^measurements must be as .*read_measurements reads them, got .*$"):
        calibrate("irb1200", given)


def test_files_may_be_given_as_paths(tmp_path: Path):
    with pytest.raises(ValueError, match=r"scenario '.*mine\.yaml': no file"):
        simulate(tmp_path / "mine.yaml", "open_loop")
    with pytest.raises(ValueError, match=r"robot '.*arm\.yaml': no file"):
        simulate("nominal", "open_loop", tmp_path / "arm.yaml")


@pytest.mark.slow
def test_springs_that_are_softer_than_believed_are_found_from_two_motions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    believed = load_robot("kr16")
    trains = [
        replace(joint.drive_train, stiffness=0.8 * joint.drive_train.stiffness) for joint in believed.joints
    ]
    softer = replace(
        believed,
        joints=[
            replace(joint, drive_train=train) for joint, train in zip(believed.joints, trains, strict=True)
        ],
    )
    motions = replace(
        default_cases(believed),
        angles_deg=[6.0],
        ringing=0.4,
        positions_deg=[[0, -90, 90, 0, 0, 0], [0, -30, 30, 0, 60, 0]],
    )
    recording = record_motions(believed, softer, motions, processes=1)
    found = identify(believed, recording, softer, gear_parts=False)
    stiffness = {each.name: each.value for each in found.parameters}
    for axis in range(3):
        ratio = stiffness[f"stiffness_gear_{axis + 1}"] / trains[axis].stiffness
        # They are believed to be a quarter stiffer than they are; two motions leave less than half of that.
        assert abs(ratio - 1.0) < 0.12, axis
    assert files(tmp_path) == set()
    assert capsys.readouterr() == ("", "")


@pytest.mark.slow
def test_a_recording_that_shows_no_spring_is_refused():
    time = 1e-3 * np.arange(80)
    theta, gyro = np.tile([0.0, -1.0, 0.7, 0.0, 0.5, 0.0], (80, 1)), np.zeros((80, 1, 3))
    place = SensorPlace("hand", "gyro", "link_5", np.zeros(3), np.eye(3), 200.0, 2e-3)
    rest = RecordedCase("rest", time, theta, 0.0 * theta, 0.0 * theta, time, gyro)
    with pytest.raises(ValueError, match="no excitation"):
        identify("kr210", Recording(100.0, [rest], [place]))
    with pytest.raises(ValueError, match="needs motions and sensors"):
        identify("kr210", Recording(100.0, [rest], []))
    slow = Recording(100.0, [replace(rest, torque=np.zeros((0, 6)))], [])
    with pytest.raises(ValueError, match="slow motions need the torques"):
        identify("kr210", Recording(100.0, [rest], [place]), slow=slow)

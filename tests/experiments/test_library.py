"""The library gives what the commands give, refuses in one line, and leaves console and disk alone."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.scenario.scenario import load_scenario
from experiments.library import calibrate, compare, design, simulate
from experiments.metrics.run_metrics import error_metrics
from robots.calibration.error_model import ErrorModel
from robots.calibration.measurements import Measurements
from robots.description.model import load_robot
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


def test_a_law_that_does_not_exist_is_refused_before_anything_runs():
    with pytest.raises(ValueError, match="did you mean pbvs"):
        compare("misaligned", ["pbvz"])


@pytest.mark.slow
def test_a_design_is_nearly_as_good_as_any():
    chosen = design("irb1200", count=12)
    assert chosen.configurations.shape == (12, 6)
    assert 0.9 * chosen.bound < chosen.b3 <= chosen.bound


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

"""The predictive correction at the end of a line: what encoders can see is more than halved."""

from functools import cache

import numpy as np
import pytest

from diagrams.scenario.scenario import ScenarioError
from experiments.feedforward.line_end import LineEnd, line_end, line_scenario, trials
from systems.feedforward.predictive.correction import PredictiveCorrection

ACROSS = 1  # the edge that goes across
ALONE, CORRECTED = 0, 1


@cache
def found(name: str, which: int, plant: str | None = None) -> LineEnd:
    trial = trials(name, plant)[which]
    return line_end(trial, line_scenario(trial, ACROSS))


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


@pytest.mark.slow
def test_with_a_third_of_the_samples_lost_hardly_more_is_left_than_uncorrected(
    monkeypatch: pytest.MonkeyPatch,
):
    """By a twentieth, for the arm rings a little otherwise."""
    is_usable = PredictiveCorrection._is_usable

    def is_there(self, time: float, sample, error: np.ndarray) -> bool:
        lost = np.random.default_rng(round(1e6 * time)).random() < 1.0 / 3.0
        return not lost and is_usable(self, time, sample, error)

    monkeypatch.setattr(PredictiveCorrection, "_is_usable", is_there)
    trial = trials("kr16")[CORRECTED]
    lossy, alone = line_end(trial, line_scenario(trial, ACROSS)), found("kr16", ALONE)
    assert lossy.motors.effective < 1.05 * alone.motors.effective
    assert lossy.tip.effective < 1.05 * alone.tip.effective


def test_drives_that_are_no_cascades_are_refused():
    trial = trials("kr16")[CORRECTED]
    scenario = line_scenario(trial, ACROSS)
    scenario.servo.laws["open_loop"].drive = "position"
    with pytest.raises(ScenarioError, match=r"predictive\.kind=motors corrects the torques .* drive=cascade"):
        line_end(trial, scenario)

"""Low-pass filters before an inverse: alike at their cutoff, two of them are the product's own."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from experiments.zeros.low_pass import (
    HERTZ,
    NAMES,
    ORDER,
    STEP,
    STEP_AT,
    TIMES,
    gain,
    overshoot,
    step_response,
)
from systems.feedforward.prefilter import Prefilter, PrefilterConfig
from tests.experiments.commands import truetip

STAGE = HERTZ / np.sqrt(2.0 ** (1.0 / ORDER) - 1.0)  # Hz, of each of four equal lags


@pytest.mark.parametrize("name", NAMES)
def test_three_decibels_are_lost_at_the_cutoff(name: str):
    assert gain(name, np.array([HERTZ]))[0] == pytest.approx(np.sqrt(0.5), rel=0.01)
    assert gain(name, np.array([10.0 * HERTZ]))[0] < 0.01


def test_butterworth_and_chebyshev_overshoot_and_the_others_do_not():
    """A Butterworth filter of fourth order by 10.8 % (textbooks), four equal lags not at all."""
    assert overshoot("critically damped") < 1e-6
    assert 0.0 < overshoot("Bessel") < 0.01
    assert overshoot("Butterworth") == pytest.approx(0.108, abs=2e-3)
    assert overshoot("Chebyshev") > overshoot("Butterworth")


@pytest.mark.parametrize(
    ("name", "kind", "cutoff"),
    [("critically damped", "critically_damped", STAGE), ("Bessel", "bessel", HERTZ)],
)
def test_the_prefilters_of_the_inverse_models_are_these(name: str, kind: str, cutoff: float):
    prefilter = Prefilter(PrefilterConfig(kind, ORDER, cutoff), STEP)
    # A step within a tick: the product's filter takes signals as linear between ticks.
    inputs = np.clip((TIMES - STEP_AT) / STEP + 0.5, 0.0, 1.0)
    state, answer = prefilter.at_rest(np.zeros(1)), [0.0]
    for before, now in pairwise(inputs):
        state = prefilter.step(state, np.array([before]), np.array([now]))
        answer.append(float(state[0, 0]))
    np.testing.assert_allclose(answer, step_response(name), atol=0.02)


def test_the_command_says_which_of_them_overshoot(tmp_path: Path):
    page = tmp_path / "zeros.html"
    result = truetip("zeros", f"--report={page}", "--example=prefilter", "--json=-")
    assert result.exit_code == 0, result.output
    assert set(json.loads(result.stdout)["overshoot"]) == set(NAMES)
    assert "figure 3.2" in page.read_text()

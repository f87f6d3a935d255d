"""What samples say beyond the estimate: reflections are none of it, a step is."""

import numpy as np
import pytest

from systems.estimation.events import Innovations

SIGMA = np.repeat([2e-4, 6e-5], 3)  # rad and m, of the camera
COLUMNS, KNOWN = np.zeros((6, 1)), np.zeros((1, 6))  # of an estimate that is exact


def judged(innovations: Innovations, memory, errors: np.ndarray) -> list:
    return [innovations.judge(memory, r, COLUMNS, lambda: KNOWN) for r in errors]


@pytest.mark.slow
def test_reflections_in_every_third_image_are_outliers_and_a_displaced_tool_is_none():
    rng = np.random.default_rng(3)
    innovations = Innovations(SIGMA**2)
    memory = innovations.layout.view(np.zeros(innovations.layout.size))
    innovations.start(memory)
    errors = SIGMA * rng.standard_normal((20_000, 6))
    false = rng.random(len(errors)) < 0.35
    errors[false] += np.repeat([0.03, 0.02], 3) * rng.standard_normal((false.sum(), 6))
    longest = max(map(len, "".join("x" if each else " " for each in false).split()))
    assert longest >= 7  # in a row
    verdicts = judged(innovations, memory, errors)
    assert np.mean([each.is_outlier for each in verdicts]) > 0.34
    assert not any(each.has_jumped or each.has_drifted for each in verdicts)
    displaced = SIGMA * rng.standard_normal((20, 6)) + np.array([0.0, 0.0, 0.0, 5e-4, 0.0, 0.0])
    assert any(each.has_jumped for each in judged(innovations, memory, displaced)[:12])  # 48 ms

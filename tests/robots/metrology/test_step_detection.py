"""Steps in a smooth motion: found, sized, dated, and none where there is only noise, bends or vibration."""

import numpy as np
import pytest

from robots.metrology.step_detection import Step, StepDetector

PERIOD, SIGMA = 0.004, 50e-6  # s, m
LEAST = 1e-4  # m


def steps(values: np.ndarray) -> list[Step]:
    detector = StepDetector(LEAST)
    found = (detector.add(PERIOD * k, value) for k, value in enumerate(values))
    return [each for each in found if each is not None]


def motion(seconds: float, seed: int) -> np.ndarray:
    """What a robot that is known to a millimetre is off by along its way, with the noise of a camera."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, PERIOD)[:, None]
    bends = sum(
        rng.uniform(0.0, 1e-3, 3) * np.sin(2 * np.pi * f * t + rng.uniform(0, 6, 3)) for f in (0.1, 0.3)
    )
    return bends + SIGMA * rng.standard_normal((len(t), 3))


@pytest.mark.parametrize("seed", range(6))
def test_a_tool_that_is_displaced_by_a_fifth_of_a_millimetre_is_known_within_a_second(seed: int):
    values = motion(8.0, seed)
    way = np.random.default_rng(seed + 100).standard_normal(3)
    shift = 2e-4 * way / np.linalg.norm(way)
    values[1000:] += shift
    (found,) = steps(values)
    assert found.onset == pytest.approx(1000 * PERIOD, abs=5 * PERIOD)
    assert 1000 * PERIOD < found.known <= 1000 * PERIOD + 0.5
    assert np.linalg.norm(found.size - shift) < 4.5 * found.sigma * np.sqrt(3.0)
    assert found.sigma < 0.25 * np.linalg.norm(shift)


def test_two_steps_are_two():
    values = motion(8.0, 1)
    values[800:] += [3e-4, 0.0, 0.0]
    values[1400:] -= [3e-4, 0.0, 0.0]
    first, second = steps(values)
    assert first.size[0] > 1e-4
    assert second.size[0] < -1e-4


def test_neither_noise_nor_bends_nor_vibration_are_steps():
    calm = motion(60.0, 5)
    t = np.arange(len(calm))[:, None] * PERIOD
    assert not steps(calm)
    assert not steps(calm + 3e-4 * np.sin(2 * np.pi * 9.0 * t) * np.exp(-np.mod(t, 3.0)))

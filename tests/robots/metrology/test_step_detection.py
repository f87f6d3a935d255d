"""Steps in a smooth motion: found, sized, dated, and none where there is only noise, bends or vibration."""

import numpy as np
import pytest

from robots.metrology.step_detection import Step, StepDetector

PERIOD, SIGMA = 0.004, 50e-6  # s, m
LEAST = 1e-4  # m


def steps(values: np.ndarray, rates: np.ndarray | None = None) -> list[Step]:
    detector, rates = StepDetector(LEAST), np.zeros_like(values) if rates is None else rates
    both = enumerate(zip(values, rates, strict=True))
    found = (detector.add(PERIOD * k, value, rate) for k, (value, rate) in both)
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


@pytest.mark.slow
def test_neither_noise_nor_bends_nor_vibration_are_steps():
    calm = motion(60.0, 5)
    t = np.arange(len(calm))[:, None] * PERIOD
    assert not steps(calm)
    assert not steps(calm + 3e-4 * np.sin(2 * np.pi * 9.0 * t) * np.exp(-np.mod(t, 3.0)))


@pytest.mark.parametrize("late", [-0.02, 0.02])
def test_what_clocks_that_are_apart_make_of_a_motion_is_no_step_and_hides_none(late: float):
    """A tool at rest that starts within a tenth of a second, and comes to rest again, four times."""
    calm = motion(8.0, 2)
    t = np.arange(len(calm)) * PERIOD
    speed = 0.1 * (np.tanh((np.mod(t, 2.0) - 0.5) / 0.04) - np.tanh((np.mod(t, 2.0) - 1.5) / 0.04))
    rates = speed[:, None] * [0.6, -0.48, 0.64]
    assert steps(calm + late * rates)
    assert not steps(calm + late * rates, rates)
    calm[1000:] += [2e-4, 0.0, 0.0]
    (found,) = steps(calm + late * rates, rates)
    assert found.onset == pytest.approx(1000 * PERIOD, abs=5 * PERIOD)


def test_an_arm_that_bends_as_it_starts_off_makes_no_step():
    """By a millimetre within a third of a second, of which the rest of the window says little."""
    calm = motion(8.0, 3)
    t = np.arange(len(calm))[:, None] * PERIOD
    assert not steps(calm + 5e-4 * np.tanh((t - 4.0) / 0.1) * [0.6, -0.48, 0.64])

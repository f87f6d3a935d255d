"""A camera is as noisy as its samples say, not as somebody believes."""

import numpy as np
import pytest

from systems.estimation.camera.camera_noise import CameraNoise
from systems.estimation.tip_model import NO_SHAPES, Pair

BELIEVED = np.repeat([2e-4, 6e-5], 3)  # rad and m, of a sample
NONE = np.empty((6, 0)), np.empty(0)


def heard(
    errors: np.ndarray, period: float = 4e-3, speed: float = 0.0, times: np.ndarray | None = None
) -> tuple[np.ndarray, int]:
    """Deviations in use after errors (n, 6) of the tip, by believed ones, and how often they have changed."""
    noise = CameraNoise(BELIEVED**2)
    memory = noise.layout.view(np.zeros(noise.layout.size))
    noise.start(memory)
    twist, changed = np.array([0.0, 0.0, 0.0, speed, 0.0, 0.0]), 0
    times = period * np.arange(len(errors)) if times is None else times
    for time, r in zip(times, errors, strict=True):
        pair = Pair(np.zeros(6), NO_SHAPES, np.zeros(12), twist, np.eye(4), time=float(time))
        changed += noise.hear(memory, r, *NONE, pair)
    np.testing.assert_allclose(memory.weights, 1.0 / memory.variances)
    return np.sqrt(memory.variances) / BELIEVED, changed


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize(("turns", "shifts"), [(5.0, 5.0), (1.0, 3.0), (4.0, 0.5)])
def test_turns_and_shifts_are_each_as_noisy_as_they_are(seed, turns, shifts):
    """What is within a factor of two in the variance is left as it is: 1.41 in the deviation, and noise."""
    rng = np.random.default_rng(seed)
    found, changed = heard(BELIEVED * np.repeat([turns, shifts], 3) * rng.normal(size=(300, 6)))
    wanted = np.maximum(1.0, np.repeat([turns, shifts], 3))
    assert (np.abs(np.log2(found / wanted)) < 0.6).all()
    assert 1 <= changed <= 3


@pytest.mark.parametrize("seed", range(10))
def test_a_camera_as_good_as_believed_changes_nothing(seed):
    assert heard(BELIEVED * np.random.default_rng(seed).normal(size=(5000, 6)))[1] == 0


def test_a_robot_that_is_off_by_more_and_more_is_no_noise():
    """By 3 mm a quarter of a second later, as the tip goes there at 0.5 m/s."""
    way = 3e-3 * np.sin(2.0 * np.pi * 4e-3 * np.arange(2000))[:, None] * np.ones(6)
    assert heard(way, speed=0.5)[1] == 0


def test_nothing_is_said_where_the_tip_goes_far_between_samples():
    errors = 5.0 * BELIEVED * np.random.default_rng(1).normal(size=(500, 6))
    assert heard(errors, period=0.02, speed=0.5)[1] == 0  # 10 mm


def test_a_step_and_lost_images_are_no_noise():
    rng = np.random.default_rng(2)
    errors = BELIEVED * rng.normal(size=(3000, 6))
    errors[1500:] += 1e-3
    kept = rng.random(len(errors)) > 0.2
    assert heard(errors[kept], times=4e-3 * np.flatnonzero(kept))[1] == 0

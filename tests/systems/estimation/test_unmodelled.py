"""What a model lacks is told from the noise of a camera, however little it is of a single sample."""

import numpy as np
import pytest

from systems.estimation.unmodelled import Doubts, Unmodelled

SIGMA = np.repeat([2e-4, 6e-5], 3)  # rad and m, of a sample
NUMBER = 5000  # samples: 20 s


def found(
    lacking: float,
    noise: float = 1.0,
    known: float = 0.0,
    events: tuple[int, ...] = (),
    by_gears: float = 0.0,
) -> np.ndarray:
    """Deviations that are found, (6,), in those of the camera, where all have a sine of ``lacking``."""
    rng = np.random.default_rng(3)
    unmodelled = Unmodelled()
    memory = unmodelled.layout.view(np.zeros(unmodelled.layout.size))
    wave = np.sqrt(2.0) * lacking * np.sin(2.0 * np.pi * np.arange(NUMBER)[:, None] / 400.0 + np.arange(6.0))
    # Innovations of an optimal filter are white, and contain what the estimate is wrong by.
    shown = SIGMA * (np.hypot(noise, known) * rng.normal(size=(NUMBER, 6)) + wave)
    by_model, gears = np.diag((known * SIGMA) ** 2 + 1e-20), np.diag((by_gears * SIGMA) ** 2)
    doubts = Doubts((noise * SIGMA) ** 2, by_model, gears, np.empty((0, 6)))
    for k, r in enumerate(shown):
        if k in events:
            r = r + 20.0 * SIGMA
        unmodelled.add(memory, r, lambda: doubts)
        if k in events:
            unmodelled.rest(memory)
    return np.sqrt(unmodelled.variances(memory)) / SIGMA


@pytest.mark.parametrize("lacking", [0.2, 1.0])
def test_a_slow_error_is_found_below_the_noise(lacking: float):
    """Its variance to some thousandths of the noise, as below, and to a tenth of its own."""
    np.testing.assert_allclose(found(lacking) ** 2, lacking**2, atol=0.012 + 0.1 * lacking**2)


@pytest.mark.parametrize("noise", [0.5, 1.0, 3.0])
def test_noise_alone_adds_next_to_nothing(noise: float):
    """The variance of means over 24 samples is 1/24 of the noise; 300 of them show it to 8 %.

    That is 0.0034 of the variance of a sample; three times as much is let pass.
    """
    assert (found(0.0, noise) ** 2).max() < 0.01 * noise**2


def test_what_the_estimate_knows_it_may_be_wrong_by_is_not_added_again():
    """It has nine times the camera's variance, 9/24 in a mean; what is found there is right to 0.025."""
    assert (found(0.0, known=3.0) ** 2).max() < 3.0 * 0.025


def test_what_gears_are_said_to_be_off_by_is_not_added_again():
    """Where they are off by 0.2 and are said to be, nothing is left, to what is let pass above."""
    assert (found(0.2, by_gears=0.2) ** 2).max() < 0.012 + 0.1 * 0.2**2


def test_a_sample_in_which_something_happened_does_not_count():
    np.testing.assert_allclose(found(0.2, events=(2000, 2001, 2002)), found(0.2), rtol=0.1)


@pytest.mark.parametrize(("said", "true"), [(20e-6, 80e-6), (80e-6, 60e-6), (80e-6, 0.0)])
def test_what_a_joint_is_off_by_is_found_whatever_is_said_of_it(said: float, true: float):
    """Its variance to a fifth of itself and of the noise of a mean; but 0.4 of what is said at least."""
    rng, J = np.random.default_rng(5), np.random.default_rng(6).normal(size=(6, 6)) + 3.0 * np.eye(6)
    unmodelled, by_gears = Unmodelled(joints=6), np.full(6, said**2)
    memory = unmodelled.layout.view(np.zeros(unmodelled.layout.size))
    doubts = Doubts(SIGMA**2, np.diag(1e-6 * SIGMA**2), (J * by_gears) @ J.T, np.linalg.inv(J))
    wave = np.sqrt(2.0) * true * np.sin(2.0 * np.pi * np.arange(NUMBER)[:, None] / 400.0 + np.arange(6.0))
    for angles in wave:
        unmodelled.add(memory, J @ angles + SIGMA * rng.normal(size=6), lambda: doubts)
    noise = (np.linalg.inv(J) ** 2) @ SIGMA**2 / 24.0
    wanted = max(true**2, 0.4 * said**2)
    np.testing.assert_array_less(
        np.abs(unmodelled.joint_variances(memory, by_gears) - wanted), 0.2 * (noise + wanted)
    )

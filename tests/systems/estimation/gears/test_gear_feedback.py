"""What is fed back of teeth that are elsewhere than expected: on which joints, how much, and for how long."""

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics
from systems.estimation.gears.gear_feedback import GearFeedback, samples_alike

PERIOD = 4e-3  # s
SIGMA = np.repeat([1.75e-4, 5e-5], 3)  # rad and m, of a camera
KNOWN = np.zeros((6, 6))  # rad^2 and m^2, what the model of the robot is off by
FREE, LOADED = 80e-6**2, 5e-6**2  # rad^2, what a gear may be off by between its flanks and under load

MOVING = np.full(6, 0.1)  # rad/s


@pytest.fixture(scope="module", name="J")
def jacobian() -> np.ndarray:
    return Kinematics(load_robot("irb1200")).jacobian(np.array([0.1, 0.3, 0.2, 0.4, 0.9, 0.3]))


def started(share: float = 0.1):
    feedback = GearFeedback(share)
    memory = feedback.layout.view(np.zeros(feedback.layout.size))
    feedback.rest(memory)
    return feedback, memory


def shown(
    feedback, memory, J, off, variances, ticks: int, noise: float = 1.0, speed: float = 0.1
) -> np.ndarray:
    """Where joints are led aside, (ticks, 3, 6), while a camera sees them off by an angle, rad, (6,)."""
    rng, rows = np.random.default_rng(0), []
    for k in range(ticks):
        r = J @ off + noise * SIGMA * rng.normal(size=6)
        feedback.hear(memory, J, r, 1.0 / SIGMA**2, KNOWN, variances, np.full(6, speed), PERIOD * k)
        rows.append(feedback.lead(memory, PERIOD, PERIOD))
    return np.array(rows)


@pytest.mark.slow
def test_half_of_what_a_joint_is_off_by_whose_teeth_lie_free_is_made_up_for(J):
    off, variances = np.zeros(6), np.full(6, LOADED)
    off[0], variances[0] = 100e-6, FREE
    aside = shown(*started(), J, off, variances, 100, noise=0.0)[-1, 0]
    assert -off[0] < aside[0] < -0.5 * off[0]
    assert np.abs(aside[1:]).max() < 5e-6


def test_of_gears_under_load_next_to_nothing_is_fed_back(J):
    off = np.array([100e-6, 0.0, 0.0, 0.0, 0.0, 0.0])
    aside = shown(*started(), J, off, np.full(6, LOADED), 100)[:, 0]
    assert np.abs(aside).max() < 0.05 * off[0]


def test_noise_of_a_camera_moves_the_tip_by_a_third_of_what_it_is(J):
    variances = np.where(np.arange(6) == 0, FREE, LOADED)
    aside = shown(*started(), J, np.zeros(6), variances, 4000)[:, 0]
    moved = np.einsum("ij,kj->ki", J[3:], aside)
    assert 0.0 < np.sqrt((moved**2).mean(axis=0)).max() < SIGMA[3] / 3.0


def test_at_rest_nearly_all_of_it_is_made_up_for_and_noise_moves_the_tip_by_a_tenth_of_what_it_is(J):
    off, variances = np.zeros(6), np.where(np.arange(6) == 0, FREE, LOADED)
    off[0] = 100e-6
    aside = shown(*started(), J, off, variances, 4000, speed=0.0)[500:, 0]
    left = np.einsum("ij,kj->ki", J[3:], aside + off)
    assert np.abs(left.mean(axis=0)).max() < 0.1 * np.linalg.norm(J[3:, 0]) * off[0]
    assert left.std(axis=0).max() < SIGMA[3] / 10.0


@pytest.mark.parametrize("by_model", [0.0, 0.2])  # of the camera's variance
def test_the_filter_is_that_of_the_textbook(J, by_model):
    """Against a Kalman filter in matrices; what the model is off by is noise that lasts, of more variance."""
    feedback, memory = started(share=0.3)
    variances, kept = np.linspace(1.0, 2.0, 6) * FREE, np.exp(-PERIOD / 0.1)
    rng, x, P = np.random.default_rng(1), np.zeros(6), np.zeros((6, 6))
    by_model = by_model * np.outer(SIGMA, SIGMA) * np.corrcoef(rng.normal(size=(6, 20)))
    for k in range(1, 30):
        r = SIGMA * rng.normal(size=6)
        x, P = kept * x, kept**2 * P + np.diag((1.0 - kept**2) * 0.3 * variances)
        if k == 1:
            P = np.diag(0.3 * variances) * (1.0 - np.exp(-2.0 * PERIOD / 0.1))
        R = np.diag(SIGMA**2) + (1.0 + 2.0 * 0.1 / PERIOD) * by_model
        gain = P @ J.T @ np.linalg.inv(J @ P @ J.T + R)
        x, P = x + gain @ (r - J @ x), P - gain @ J @ P
        feedback.hear(memory, J, r, 1.0 / SIGMA**2, by_model, variances, MOVING, PERIOD * k)
        np.testing.assert_allclose(memory.off, x, rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(memory.P, P, rtol=1e-9, atol=1e-22)


def test_little_is_fed_back_while_the_robot_is_little_known(J):
    """A camera shows what teeth and parameters are off by together; the latter are about to be learnt."""
    off, aside = np.array([100e-6, 0.0, 0.0, 0.0, 0.0, 0.0]), []
    for by_model in (0.0, 100e-6**2):  # rad^2, in the same joint
        feedback, memory = started(share=0.3)
        for k in range(200):
            doubt = by_model * np.outer(J[:, 0], J[:, 0])
            hear = 1.0 / SIGMA**2, doubt, np.full(6, FREE), MOVING, PERIOD * k
            feedback.hear(memory, J, J @ off, *hear)
        aside.append(memory.off[0])
    # Of an angle that stays, a part is always being forgotten; a doubt leaves a sixth of the rest at most.
    assert aside[0] > 0.6 * off[0]
    assert aside[1] < 0.2 * off[0]


def test_so_many_samples_say_no_more_than_one_that_their_noise_is_as_that_of_an_angle_that_lasts():
    """A constant is known from an Ornstein-Uhlenbeck process as well as from such noise."""
    times, ones = PERIOD * np.arange(1000), np.ones(1000)
    covariance = np.exp(-np.abs(times[:, None] - times) / 0.1)
    exact = 1.0 / (ones @ np.linalg.solve(covariance, ones))
    assert samples_alike(PERIOD) / 1000 == pytest.approx(exact, rel=0.1)  # but for both ends


def test_what_was_seen_is_forgotten_where_the_camera_is_blind_and_after_a_dead_time(J):
    feedback, memory = started()
    off, variances = np.array([100e-6, 0.0, 0.0, 0.0, 0.0, 0.0]), np.full(6, FREE)
    before = shown(feedback, memory, J, off, variances, 100, noise=0.0)[-1, 0, 0]
    last = PERIOD * 99
    late = [feedback.lead(memory, PERIOD * k, PERIOD)[0, 0] for k in range(1, 250)]
    assert abs(late[-1]) < 1e-3 * abs(before)
    assert memory.exposure[0] == last


def test_a_sample_that_no_gear_explains_is_left_alone(J):
    feedback, memory = started()
    r = np.array([0.0, 0.0, 0.0, 5.0 * SIGMA[3], 0.0, 0.0])
    feedback.hear(memory, J, r, 1.0 / SIGMA**2, KNOWN, np.full(6, FREE), MOVING, PERIOD)
    assert not memory.off.any()


def test_rates_are_those_of_the_way(J):
    off = np.array([100e-6, 0.0, 0.0, 0.0, 0.0, 0.0])
    aside = shown(*started(), J, off, np.full(6, FREE), 60)
    way, rate, acceleration = aside[:, 0], aside[:, 1], aside[:, 2]
    np.testing.assert_allclose(np.diff(way, axis=0), PERIOD * rate[1:], rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(np.diff(rate, axis=0), PERIOD * acceleration[1:], rtol=1e-9, atol=1e-12)


def test_heavy_links_with_soft_dampers_are_led_more_slowly():
    feedback, damping = GearFeedback(0.3), np.array([80.0, 80.0, 80.0, 30.0, 30.0, 30.0])
    feedback.suit(damping, np.array([10.0, 5.0, 1.0, 1.0, 0.5, 0.5]))
    np.testing.assert_allclose(feedback.frequency, [8.0 * 0.3 * 80.0 / 10.0, 38.4, 40.0, 40.0, 40.0, 40.0])


def test_at_rest_a_dead_time_keeps_nothing_of_it_from_being_made_up_for(J):
    off = np.array([100e-6, 0.0, 0.0, 0.0, 0.0, 0.0])
    made_up_for = []
    for speed in (0.0, 0.1):
        feedback, memory = started()
        shown(feedback, memory, J, off, np.full(6, FREE), 500, noise=0.0, speed=speed)
        late = [feedback.lead(memory, 0.14, PERIOD)[0, 0] for _ in range(200)]
        made_up_for.append(-late[-1] / memory.off[0])
    assert made_up_for[0] > 0.98
    assert made_up_for[1] == pytest.approx(np.exp(-1.4), rel=0.01)

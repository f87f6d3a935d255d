"""What is supposed until samples speak against it, against estimates that never supposed it."""

import copy

import numpy as np
import pytest

from systems.estimation.suppositions import Suppositions
from tests.systems.estimation.arms import tip_model

MODEL = tip_model()


def supposed(model=MODEL):
    suppositions = Suppositions(model)
    memory = suppositions.layout.view(np.zeros(suppositions.layout.size))
    suppositions.start(memory)
    return suppositions, memory


def look_twice(suppositions, memory, P, b):
    return suppositions.look(memory, P, b, True) or suppositions.look(memory, P, b, True)


def samples_of(x: np.ndarray, rows: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Information H^T H of some rows, and H^T y where y is what x gives, without noise."""
    H = np.random.default_rng(seed).normal(size=(rows, len(x)))
    return H.T @ H, H.T @ (H @ x)


@pytest.mark.parametrize("load", [0.0, 6.0])
def test_what_is_given_up_is_what_is_wrong_and_the_estimate_is_as_if_it_had_never_been_supposed(load):
    suppositions, memory = supposed()
    x = np.zeros(MODEL.size)
    x[MODEL.M.start] = load / MODEL.sigma[MODEL.M][0]
    A, b = samples_of(x, 3 * MODEL.size)
    before = suppositions.prior(memory)
    found = look_twice(suppositions, memory, np.linalg.inv(A + before), b)
    if not load:
        assert found is None
        return
    assert found is not None
    event, change = found
    assert event.kind == "load unlike belief"
    assert event.size == pytest.approx(load, rel=0.05)
    P = np.linalg.inv(A + before + change)
    wrong = MODEL.M.start
    assert event.size == pytest.approx(MODEL.sigma[wrong] * (P @ b)[wrong], rel=1e-6)
    assert look_twice(suppositions, memory, P, b) is None


@pytest.mark.parametrize("settled", [(False, False), (True, False), (False, True), (True, False, True)])
def test_the_load_is_not_given_up_by_samples_that_were_linearised_far_off(settled):
    suppositions, memory = supposed()
    x = np.zeros(MODEL.size)
    x[MODEL.M.start] = 6.0 / MODEL.sigma[MODEL.M][0]
    A, b = samples_of(x, 3 * MODEL.size)
    P = np.linalg.inv(A + suppositions.prior(memory))
    assert not any(suppositions.look(memory, P, b, is_settled) for is_settled in settled)


@pytest.mark.parametrize(
    ("load", "is_given_up"), [(-6.5, True), (1.5, True), (1.0, False), (8.0, False), (-9.0, False)]
)
def test_what_gears_do_is_not_taken_for_a_load_that_no_robot_carries(load, is_given_up):
    """A robot that carries 7 kg, and 7 kg that are believed; its centre is elsewhere, too."""
    model = tip_model(gear_error=5e-5)
    suppositions, memory = supposed(model)
    x = np.zeros(model.size)
    x[model.M.start], x[model.M.start + 1] = load / model.sigma[model.M][0], 8.0
    A, b = samples_of(x, 10 * model.size)
    found = look_twice(suppositions, memory, np.linalg.inv(A + suppositions.prior(memory)), b)
    assert (found is not None) == is_given_up


def test_a_load_within_its_spread_is_what_was_believed():
    suppositions, memory = supposed()
    x = np.zeros(MODEL.size)
    x[MODEL.M.start] = 2.0
    A, b = samples_of(x, 3 * MODEL.size)
    assert look_twice(suppositions, memory, np.linalg.inv(A + suppositions.prior(memory)), b) is None


def test_who_believes_that_a_load_may_be_any_has_nothing_to_give_up():
    model = copy.copy(MODEL)
    model.changed_load = np.full(4, 0.5)  # of the spreads that are believed
    suppositions, memory = supposed(model)
    x = np.zeros(MODEL.size)
    x[MODEL.M] = 2.0
    A, b = samples_of(x, 3 * MODEL.size)
    before = suppositions.prior(memory)
    assert look_twice(suppositions, memory, np.linalg.inv(A + before), b) is None
    memory.load[0] = 0.0
    np.testing.assert_array_equal(suppositions.prior(memory), before)

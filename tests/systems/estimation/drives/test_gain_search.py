"""Gains of drives that nobody told, found from motors that follow another solution of their cascades."""

import numpy as np
import pytest
from scipy.signal import TransferFunction, lsim

from systems.estimation.drives.gain_search import TORQUES
from systems.estimation.kernels import drive_columns as at
from tests.systems.estimation.drives.motors import LOADS, PERIOD, drives, motion

BELIEVED = np.array([25.0, 10.0])  # 1/s, of position and of the integral
ARMS = np.random.default_rng(2).normal(0.0, (10.0, 10.0, 6.0, 1.0, 1.0, 0.3), (4, 6))  # N m
# Where torques are sent: shares of rotor and friction that the file has wrong, kg not held, kg m
UNLIKE = {at.W_ROTOR: 0.4, at.W_VISCOUS: -0.3, at.W_NOT_HELD: 3.0, at.W_LOADS: 0.4, at.W_LOADS + 1: 0.05}


def searched(position, integral, give, friction=0.2, noise=0.0, unlike=None):
    """What is found of motors with such factors of the gains.

    Their friction is more than believed; where they take torques they lack what is unlike belief: that share
    of a place of `TORQUES`.
    """
    model, memory = drives(takes_torque=unlike is not None)
    search = model.search
    sums = search.layout.view(np.zeros(search.layout.size))
    times = PERIOD * np.arange(900)
    torques = []
    for time in times:
        loads = LOADS.copy()
        loads[1:, :6] = ARMS * np.roll(motion(time)[0], 1)  # of a kilogram, and of a kg m along x, y and z
        command = model.command(memory, motion(time), loads, 7.0)
        torques.append(command.torques)
    torques = np.array(torques)
    factors = np.zeros(len(TORQUES))
    factors[[0, 2]] = 1.0, friction
    for place, share in (unlike or {}).items():
        factors[TORQUES.index(place)] = share
    missing = np.einsum("k,tkj->tj", factors, torques)
    behind = np.empty((len(times), 6))
    for j, kd in enumerate(model._drives.kd / give):
        p, i = BELIEVED * (position, integral)
        cascade = TransferFunction([1.0, 0.0], kd * np.array([1.0, p + i, p * i]))
        behind[:, j] = lsim(cascade, missing[:, j] - missing[0, j], times)[1]
    behind += np.random.default_rng(1).normal(0.0, noise, behind.shape)
    for time, w, each in zip(times, torques, behind, strict=True):
        search.follow(sums, w)
        search.add(sums, np.array([motion(time)[1], np.zeros(6)]), each)
    assert command.torques.shape == (len(TORQUES), 6)
    return search.find(sums, 1.0, 1.0)


@pytest.mark.parametrize(
    ("position", "integral", "give"), [(0.6, 0.5, 1.67), (0.5, 0.5, 1.0), (1.8, 2.2, 0.6), (1.0, 0.4, 1.3)]
)
def test_gains_far_from_what_is_believed_are_found(position, integral, give):
    """To half a step of a grid of 1.6 to one: both lie in a valley, one nearly makes what the other makes."""
    found = searched(position, integral, give, noise=1e-5)
    assert found
    (p, i), true = BELIEVED * found[:2], BELIEVED * (position, integral)
    assert p + i == pytest.approx(true.sum(), rel=0.25)
    assert p * i == pytest.approx(true.prod(), rel=0.25)
    # What counts is how far motors give way to torques that change slowly.
    np.testing.assert_allclose(found.give / (p * i), give / true.prod(), rtol=0.15)


@pytest.mark.parametrize(("friction", "give"), [(0.0, 1.0), (0.5, 1.0), (0.2, 1.4), (0.2, 0.7)])
def test_gains_as_believed_stay_whatever_else_is_wrong(friction, give):
    assert searched(1.0, 1.0, give, friction, noise=1e-5) is None


@pytest.mark.parametrize(("position", "integral"), [(0.6, 0.5), (0.5, 0.5), (0.5, 1.0)])
def test_they_are_found_where_torques_are_sent_from_what_these_leave(position, integral):
    found = searched(position, integral, 1.0, noise=1e-5, unlike=UNLIKE)
    assert found
    (p, i), true = BELIEVED * found[:2], BELIEVED * (position, integral)
    assert p + i == pytest.approx(true.sum(), rel=0.3)
    assert p * i == pytest.approx(true.prod(), rel=0.3)


@pytest.mark.parametrize("takes_torque", [False, True])
def test_the_least_squares_of_all_joints_are_those_of_one_dense_system(takes_torque):
    """Joint by joint, what is its own is eliminated; here all unknowns of a pair of gains stand in a row."""
    search, rng = drives(takes_torque=takes_torque)[0].search, np.random.default_rng(3)
    sums = search.layout.view(np.zeros(search.layout.size))
    k, shared, own = sums.z.shape[1], search._shared, search._own
    variances, at = rng.uniform(0.5, 2.0, 6), 7  # of a joint; which pair of gains
    rows, seen = [], []
    for _ in range(40):
        sums.z[:] = rng.normal(size=sums.z.shape)
        late, behind = rng.normal(size=(2, 6)), rng.normal(size=6)
        left = np.exp(-PERIOD * sums.samples[0] * search._slowest[at])
        for j in range(6):
            columns = np.array([*sums.z[at, :, j, 1], *late[:, j], 1.0, left])
            row = np.zeros(len(shared) + 6 * len(own))
            row[: len(shared)] = columns[shared]
            row[len(shared) + j * len(own) :][: len(own)] = columns[own]
            rows.append(row / np.sqrt(variances[j]))
            seen.append(behind[j] / np.sqrt(variances[j]))
        search.add(sums, late, behind)
    prior = np.sqrt(np.concatenate((search._of_shared, np.tile(search._of_own, 6))))
    expected = np.zeros(len(prior))
    expected[0] = prior[0]  # one, of how far motors give way
    A, b = np.vstack((rows, np.diag(prior))), np.concatenate((seen, expected))
    x, (square,), *_ = np.linalg.lstsq(A, b, rcond=None)
    lower = sums.A + np.tril(sums.A, -1).swapaxes(-1, -2)
    misfit, _, factors = search._fit(sums, lower, variances)
    np.testing.assert_allclose(misfit[at], square, rtol=1e-9)
    dense = np.zeros((6, k + 4))
    dense[:, shared] = x[: len(shared)]
    dense[:, own] += x[len(shared) :].reshape(6, len(own))
    np.testing.assert_allclose(factors[at], dense, rtol=1e-7, atol=1e-10)


@pytest.mark.parametrize("share", [0.0, 1.0, -1.0])
def test_where_torques_are_sent_gains_as_believed_stay_whatever_else_is_wrong(share):
    unlike = {place: share * each for place, each in UNLIKE.items()}
    assert searched(1.0, 1.0, 1.0, 0.3 * share, noise=1e-5, unlike=unlike) is None


def test_motors_at_rest_do_not_leap_when_gains_are_taken():
    model, memory = drives(takes_torque=False)
    theta, still = motion(0.3)[0], np.zeros(6)
    for _ in range(600):  # until what they were behind by is gone
        before = model.command(memory, (theta, still, still), LOADS, 7.0)
    memory.beta[:] = 0.1
    found = searched(0.6, 0.5, 1.67)
    assert found
    model.prepare_gains(memory, found)
    assert memory.gains.factors.tolist() == [1.0, 1.0]
    assert model.take_gains(memory) == pytest.approx(1.67 / 0.3, rel=0.15)
    after = model.command(memory, (theta, still, still), LOADS, 7.0)
    np.testing.assert_allclose(after.position, before.position, atol=1e-9)
    np.testing.assert_allclose(memory.gains.factors, found[:2])
    assert not memory.coming.factors.any()
    assert not memory.beta[1:].any()  # but for the dead time


def test_commands_do_not_leap_while_motors_still_come_to_rest():
    """What they are behind by fades with the new gains; before, it was gone in a tick."""
    model, memory = drives(takes_torque=False)
    still = np.zeros(6)
    for time in PERIOD * np.arange(300):
        model.command(memory, motion(time), LOADS, 7.0)
    theta = motion(0.3)[0]
    ahead = [model.command(memory, (theta, still, still), LOADS, 7.0).position - theta for _ in range(20)]
    found = searched(0.6, 0.5, 1.67)
    assert found
    model.prepare_gains(memory, found)
    model.take_gains(memory)
    after = model.command(memory, (theta, still, still), LOADS, 7.0).position - theta
    leap = np.abs(after - ahead[-1]).max()
    assert leap < 1.5 * np.abs(ahead[-1] - ahead[-2]).max()
    assert np.abs(ahead[-1]).max() > 10.0 * leap


def test_stiffer_ones_are_not_looked_for_where_torques_are_sent():
    assert searched(2.0, 2.0, 1.0, noise=1e-7, unlike=UNLIKE) is None


def test_motors_follow_their_plan_with_the_gains_that_were_found():
    """In a simulation of the cascade that the model does not share, to a few parts in a hundred."""
    position, integral, give = 0.6, 0.5, 1.67
    left = {}
    for is_told in (False, True):
        model, memory = drives(takes_torque=False)
        if is_told:
            found = searched(position, integral, give)
            assert found
            model.prepare_gains(memory, found)
            model.take_gains(memory)
        times = PERIOD * np.arange(900)
        ahead, missing = [], []
        for time in times:
            theta = motion(time)[0]
            ahead.append(model.command(memory, motion(time), LOADS, 7.0).position - theta)
            missing.append(memory.w[0].copy())
        ahead, missing = np.array(ahead), np.array(missing)
        kd, (p, i) = model._drives.kd[1] / give, BELIEVED * (position, integral)
        cascade = TransferFunction([1.0, 0.0], kd * np.array([1.0, p + i, p * i]))
        behind = lsim(cascade, missing[:, 1] - missing[0, 1], times)[1]
        left[is_told] = np.abs(ahead[:, 1] - behind)[400:].max() / np.abs(behind)[400:].max()
    assert left[False] > 0.5
    assert left[True] < 0.12

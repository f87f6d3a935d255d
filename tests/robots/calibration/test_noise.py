"""Noise that is known or estimated: what it does to the result, and whether the stated errors are honest."""

from dataclasses import replace

import numpy as np
import pytest

from robots.calibration.error_model import ErrorModel
from robots.calibration.identification import IdentificationConfig, identify
from robots.calibration.identified import Identified
from robots.calibration.measurements import SOURCE_NOISE, MeasurementNoise, Measurements
from robots.calibration.reduction import ReducibleModel
from robots.calibration.validation import plausible_rows
from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics
from tests.robots.calibration.matrix_robot import MatrixRobot

NOMINAL, DRAWN = load_robot("irb1200"), MatrixRobot("irb1200")
KNOWN, ESTIMATED = IdentificationConfig(noise=SOURCE_NOISE), IdentificationConfig()
REDUCIBLE = ReducibleModel(ErrorModel(NOMINAL))
NAMED = REDUCIBLE.independent(np.zeros(54))  # one set for all tables


def table_of(
    seed: int, noise: MeasurementNoise = SOURCE_NOISE, count: int = 75
) -> tuple[Measurements, MatrixRobot]:
    """Poses of a robot with errors of 6 mm and 0.9 degrees."""
    rng = np.random.default_rng(seed)
    true = DRAWN.displaced(rng)
    q = DRAWN.configurations(count, rng)
    X_WE = true.forward(q)
    return Measurements(q, X_WE[:, :3, 3], X_WE[:, :3, :3]).noisy(noise, rng), true


def error(result: Identified, true: MatrixRobot) -> float:
    """Mean distance at fresh poses in mm."""
    q = DRAWN.configurations(100, np.random.default_rng(7))
    X_WE = Kinematics(result.calibrated_robot()).forward(q)
    return float(1e3 * np.mean(np.linalg.norm((X_WE - true.forward(q))[:, :3, 3], axis=1)))


def is_covered(result: Identified, true: MatrixRobot) -> np.ndarray:
    """Which true values lie in their 95 % intervals."""
    found = REDUCIBLE.reduce(result.x, NAMED)
    covariance = found.combination @ result.free_covariance @ found.combination.T
    truth = REDUCIBLE.describe(true.forward, NAMED, result.x)
    return np.abs(found.values - truth) <= 1.96 * np.sqrt(np.diagonal(covariance))


@pytest.mark.slow
def test_estimated_noise_is_as_good_as_known_noise():
    """Ten tables: within 5 % of the accuracy, and 300 intervals that hold as often as they say."""
    errors, covered = {"known": [], "estimated": []}, []
    for seed in range(10):
        table, true = table_of(seed)
        errors["known"].append(error(identify(NOMINAL, table, KNOWN), true))
        result = identify(NOMINAL, table)
        errors["estimated"].append(error(result, true))
        covered.append(is_covered(result, true))
    assert np.mean(errors["estimated"]) <= 1.05 * np.mean(errors["known"])
    assert np.mean(covered) == pytest.approx(0.95, abs=0.03)


@pytest.mark.slow
def test_intervals_hold_as_often_as_they_say():
    """200 tables: the spread of a share of 0.95 is 0.015 for one parameter."""
    covered = np.array(
        [is_covered(identify(NOMINAL, table, ESTIMATED), true) for table, true in map(table_of, range(200))]
    )
    assert 0.94 <= covered.mean() <= 0.96
    assert covered.mean(axis=0).min() >= 0.90
    assert covered.mean(axis=0).max() <= 0.99


@pytest.mark.slow
def test_the_three_noises_are_found():
    """15 tables of 450 numbers: joints to a few percent, position to a tenth, rotation between."""
    found = np.array([[*vars(identify(NOMINAL, table_of(seed)[0]).noise).values()] for seed in range(15)])
    wanted = [SOURCE_NOISE.joint_sigma, SOURCE_NOISE.position_sigma, SOURCE_NOISE.rotation_sigma]
    np.testing.assert_allclose(found.mean(axis=0), wanted, rtol=0.15)


@pytest.mark.slow
def test_rows_that_say_how_noisy_they_are_are_weighed_so():
    """A second instrument, ten times worse, wrote half of the rows; its columns say so."""
    worse = replace(SOURCE_NOISE, position_sigma=1e-3, rotation_sigma=10 * SOURCE_NOISE.rotation_sigma)
    gaps = {"told": [], "not told": []}
    for seed in range(4):
        rng = np.random.default_rng(seed)
        exact, true = table_of(seed, MeasurementNoise())
        half = np.arange(75) < 38
        better, bad = exact.noisy(SOURCE_NOISE, rng), exact.noisy(worse, rng)
        assert better.rotation is not None
        assert bad.rotation is not None
        table = replace(
            better,
            q=np.where(half[:, None], better.q, bad.q),
            position=np.where(half[:, None], better.position, bad.position),
            rotation=np.where(half[:, None, None], better.rotation, bad.rotation),
        )
        sigmas = np.where(half[:, None], [*vars(SOURCE_NOISE).values()], [*vars(worse).values()])
        gaps["told"].append(error(identify(NOMINAL, replace(table, sigmas=sigmas)), true))
        gaps["not told"].append(error(identify(NOMINAL, table), true))
    assert np.mean(gaps["told"]) < 0.9 * np.mean(gaps["not told"])


def test_noise_that_is_believed_too_small_shows_in_the_misfit():
    table, _ = table_of(0)
    assert identify(NOMINAL, table, KNOWN).misfit == pytest.approx(1.0, abs=0.15)
    tenth = MeasurementNoise(*(0.1 * sigma for sigma in vars(SOURCE_NOISE).values()))
    assert identify(NOMINAL, table, IdentificationConfig(noise=tenth)).misfit == pytest.approx(10.0, abs=1.5)


@pytest.mark.slow
def test_a_radian_is_not_weighed_as_a_metre():
    """Orientations thirty times worse than in the source do no harm: positions alone are no better."""
    bad = replace(SOURCE_NOISE, rotation_sigma=30 * SOURCE_NOISE.rotation_sigma)
    with_rotation, alone = [], []
    for seed in range(4):
        table, true = table_of(seed, bad)
        with_rotation.append(error(identify(NOMINAL, table), true))
        alone.append(error(identify(NOMINAL, table.without_rotation()), true))
    assert np.mean(with_rotation) <= 1.05 * np.mean(alone)


def test_noise_that_rows_say_is_shown_as_they_say_it_and_judges_fresh_rows():
    """The root of the mean square of a table's own sigmas; a row 20 mm off stands out of them."""
    table, _ = table_of(0)
    sigmas = np.outer(np.where(np.arange(75) < 38, 1.0, 2.0), [*vars(SOURCE_NOISE).values()])
    result = identify(NOMINAL, replace(table, sigmas=sigmas))
    shown = [*vars(result.noise).values()]
    np.testing.assert_allclose(shown, np.sqrt(np.mean(sigmas**2, axis=0)), rtol=1e-12)
    fresh, _ = table_of(0, MeasurementNoise())
    position = fresh.position.copy()
    position[3] += 0.02
    for says in (sigmas, np.zeros((0, 3))):  # the fresh table may say it, too
        plausible = plausible_rows(result, replace(fresh, position=position, sigmas=says))
        assert np.flatnonzero(~plausible).tolist() == [3]


def errors_by_sigmas(result: Identified, true: MatrixRobot) -> float:
    """Root mean square over fresh positions of what is wrong with them, in units of what is said to be."""
    q = DRAWN.configurations(100, np.random.default_rng(7))
    X_WE, Theta = result.model.forward_and_regressor(q, result.x)
    A = Theta[:, 3:, result.free]
    variances = np.einsum("nij,jk,nik->ni", A, result.free_covariance, A)
    return float(np.sqrt(np.mean((X_WE - true.forward(q))[:, :3, 3] ** 2 / variances)))


@pytest.mark.parametrize(("count", "position_only"), [(9, True), (12, True), (5, False), (6, False)])
def test_rows_that_leave_nothing_over_are_not_taken_for_exact(count: int, position_only: bool):
    """Parameters explain as many numbers as there are of them; the usual noise keeps intervals honest."""
    usual = replace(SOURCE_NOISE, joint_sigma=0.0)
    ratios = []
    for seed in range(6):
        table, true = table_of(seed, usual, count)
        result = identify(NOMINAL, table.without_rotation() if position_only else table)
        assert result.noise_belief is not None
        assert 0.2 < result.noise.position_sigma / usual.position_sigma < 3.0
        ratios.append(errors_by_sigmas(result, true))
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 1.6


def test_rows_that_leave_numbers_over_tell_their_noise():
    """15 positions without noise are still known to have none."""
    table, true = table_of(0, MeasurementNoise(), 15)
    result = identify(NOMINAL, table.without_rotation())
    assert result.noise_belief is None
    assert error(result, true) < 1e-6

"""The test of what a fit leaves over against two fits one inside the other, as any textbook has it."""

from typing import Any

import numpy as np
import pytest
from scipy import stats

from robots.calibration.solver.left_over import GravityTest, gravity_test
from robots.calibration.solver.problem import Linearised

ROWS, NUMBERS, PARAMETERS, SPRINGS = 12, 3, 5, 4


class White:
    """Noise of one unit in every number."""

    def whitening(self, J: np.ndarray) -> np.ndarray:
        return np.tile(np.eye(J.shape[1]), (len(J), 1, 1))


def found(seed: int, sag: float) -> tuple[GravityTest, float]:
    """The test, and the chance by scipy's F of the sums of squares of both fits."""
    random = np.random.default_rng(seed)
    # So large that a prior of one unit says nothing beside the rows.
    A = 1e4 * random.standard_normal((ROWS, NUMBERS, PARAMETERS))
    C = random.standard_normal((ROWS, NUMBERS, SPRINGS))
    e = random.standard_normal((ROWS, NUMBERS)) + sag * C.sum(axis=2)
    noise: Any = White()
    test = gravity_test(Linearised(e, A, np.zeros((ROWS, NUMBERS, 6))), np.zeros(PARAMETERS), C, noise)
    without, beside = A.reshape(-1, PARAMETERS), np.dstack((A, C)).reshape(-1, PARAMETERS + SPRINGS)
    more, less = (np.linalg.lstsq(columns, e.ravel(), rcond=None)[1][0] for columns in (without, beside))
    spare = ROWS * NUMBERS - PARAMETERS - SPRINGS
    return test, float(stats.f.sf((more - less) / SPRINGS / (less / spare), SPRINGS, spare))


@pytest.mark.parametrize("sag", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("seed", range(5))
def test_the_chance_is_that_of_two_least_squares_one_inside_the_other(seed: int, sag: float):
    test, chance = found(seed, sag)
    assert test.chance == pytest.approx(chance, rel=1e-4)  # of a prior of 1e-8 of the rows


def test_places_where_nothing_was_measured_change_nothing():
    """Rows of one point each, and the same rows with an empty place for a second one."""
    random = np.random.default_rng(3)
    noise: Any = White()
    A, C = (random.standard_normal((ROWS, NUMBERS, count)) for count in (PARAMETERS, SPRINGS))
    parts = [random.standard_normal((ROWS, NUMBERS)) + 3.0 * C.sum(axis=2), A, C]
    tests = []
    for points in (1, 2):
        e, A, C = (np.concatenate([each, *[0.0 * each] * (points - 1)], axis=1) for each in parts)
        at = Linearised(e, A, np.zeros((*e.shape, 6)))
        measured = np.tile(np.arange(points * NUMBERS) < NUMBERS, (ROWS, 1))
        tests.append(gravity_test(at, np.zeros(PARAMETERS), C, noise, measured))
    assert tests[1].chance == pytest.approx(tests[0].chance)
    assert tests[1].explained == pytest.approx(tests[0].explained)


def test_noise_alone_has_every_chance_as_often_as_any_other():
    chances = [found(seed, 0.0)[0].chance for seed in range(300)]
    assert stats.kstest(chances, "uniform").pvalue > 0.01


def test_what_follows_the_weight_is_told_by_how_far_it_moves_tips():
    test, _ = found(0, 10.0)
    assert test.is_clear
    assert test.explained == pytest.approx(10.0 * np.sqrt(SPRINGS * NUMBERS), rel=0.3)  # rms over few rows

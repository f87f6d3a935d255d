"""The banded program of the predictive correction against dense solutions of the same least squares."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from robots.description.model import NUM_JOINTS
from systems.feedforward.predictive.forecast import Cascade, Forecast
from systems.feedforward.predictive.program import CorrectionProgram

CASCADE, T, TICKS, SMOOTHNESS = Cascade(3500.0, 100.0, 25000.0), 4e-3, 12, 1e-3


def forecast(rng: np.random.Generator, limit: float) -> Forecast:
    """Motors somewhere, of which the correction of the next tick is under way already.

    Inertia and slope are those to which the program rounds.
    """
    upper = np.full((TICKS, NUM_JOINTS), limit)
    lower = -upper
    lower[0] = upper[0] = rng.uniform(-0.1, 0.1, NUM_JOINTS)
    return Forecast(
        error=rng.normal(0.0, 1e-4, NUM_JOINTS),
        error_rate=rng.normal(0.0, 1e-3, NUM_JOINTS),
        integral=rng.normal(0.0, 0.1, NUM_JOINTS),
        inertia=0.02 * rng.integers(25, 150, NUM_JOINTS),
        friction_slope=2.0 * rng.integers(0, 50, (TICKS, NUM_JOINTS)),
        disturbance=np.cumsum(rng.normal(0.0, 0.1, (TICKS, NUM_JOINTS)), axis=0),
        lower=lower,
        upper=upper,
    )


def errors(of: Forecast, joint: int, u: np.ndarray) -> np.ndarray:
    """The motion equation step by step: implicit in error and integral."""
    e, rate, w, m = of.error[joint], of.error_rate[joint], of.integral[joint], of.inertia[joint]
    found = []
    for k in range(TICKS):
        drive = CASCADE.proportional + CASCADE.integral * T
        damping = CASCADE.derivative + of.friction_slope[k, joint]
        free = m * rate / T - drive * e - w + of.disturbance[k, joint] - u[k]
        rate = free / (m / T + damping + drive * T)
        e += T * rate
        w += CASCADE.integral * T * e
        found.append(e)
    return np.array(found)


def dense_solution(of: Forecast, joint: int) -> np.ndarray:
    """Of the same cost over the free corrections alone, by bounded least squares."""
    first = of.lower[0, joint]
    held = np.concatenate([[first], np.zeros(TICKS - 1)])
    free = errors(of, joint, held)
    response = np.array([errors(of, joint, held + unit) - free for unit in np.eye(TICKS)[1:]]).T
    change = SMOOTHNESS * (np.eye(TICKS - 1) - np.eye(TICKS - 1, k=-1))
    start = np.concatenate([[SMOOTHNESS * first], np.zeros(TICKS - 2)])
    bounds = (of.lower[1:, joint], of.upper[1:, joint])
    found = lsq_linear(
        np.vstack([response, change]), np.concatenate([-free, start]), bounds, method="bvls", tol=1e-14
    )
    return np.concatenate([[first], found.x])


@pytest.mark.parametrize("limit", [100.0, 0.1], ids=["free", "at its bounds"])
def test_the_banded_solution_is_the_dense_one(limit: float):
    """To a hundredth of what the correction is for: the solver works to 1e-4 of errors of 0.1 mrad."""
    program, rng = CorrectionProgram(CASCADE, SMOOTHNESS, T, TICKS), np.random.default_rng(0)
    for _ in range(10):
        of = forecast(rng, limit)
        found = program.solve(of)
        assert found is not None
        wanted = np.array([dense_solution(of, joint) for joint in range(NUM_JOINTS)]).T
        if limit < 1.0:
            assert (np.abs(wanted) > 0.99 * limit).any()
        assert found == pytest.approx(wanted, abs=5e-3)


def test_without_bounds_in_the_way_no_solver_is_needed():
    """The free optimum is what the solver finds, to its accuracy, and is the dense one to rounding."""
    program, rng = CorrectionProgram(CASCADE, SMOOTHNESS, T, TICKS), np.random.default_rng(2)
    for _ in range(10):
        of = forecast(rng, 100.0)
        free, bounded = program.solve(of), program.bounded(of)
        assert free == pytest.approx(bounded, abs=5e-3)
        wanted = np.array([dense_solution(of, joint) for joint in range(NUM_JOINTS)]).T
        assert free == pytest.approx(wanted, abs=1e-7)


def test_motors_on_their_commands_are_left_alone():
    rest, zero = np.zeros((TICKS, NUM_JOINTS)), np.zeros(NUM_JOINTS)
    bound = np.ones_like(rest)
    still = Forecast(zero, zero, zero, np.ones(NUM_JOINTS), rest, rest, -bound, bound)
    assert CorrectionProgram(CASCADE, SMOOTHNESS, T, TICKS).solve(still) == pytest.approx(0.0, abs=1e-9)


def test_the_solution_depends_on_the_forecast_alone():
    """What was solved before leaves nothing behind, not even rounding: a second run is the first again."""
    rng = np.random.default_rng(1)
    forecasts = [forecast(rng, 0.5) for _ in range(20)]
    program = CorrectionProgram(CASCADE, SMOOTHNESS, T, TICKS)
    first, second = ([program.bounded(each) for each in order] for order in (forecasts, forecasts[::-1]))
    for alone, again in zip(first, second[::-1], strict=True):
        assert alone is not None
        np.testing.assert_array_equal(alone, again)

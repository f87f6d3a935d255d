"""Gears whose teeth are elsewhere than expected, in the samples from which a robot is learnt."""

import numpy as np
import pytest

from robots.pose import pose_error
from systems.estimation.tip_estimator import TipEstimator
from systems.estimation.tip_estimator_config import TipEstimatorConfig
from systems.estimation.tip_model import TipModel, moved
from tests.systems.estimation.arms import PERIOD, MovingArm, tip_model, true_unknowns

OFF = np.array([100e-6, 0.0, 0.0, 60e-6, 0.0, 0.0])  # rad, standard deviation of what joints are off by
LASTS = 0.1  # s


def said(model: TipModel, variances: np.ndarray) -> TipModel:
    """The model, whose gears are said to be off by that."""
    setattr(model, "gear_variances", lambda *_: variances)  # noqa: B010, an instance's own
    return model


def learnt(model: TipModel, seed: int, duration: float, wrong: float = 1.0):
    """An estimator after that time with an arm that is wrong, whose gears are off; its memory; the arm."""
    arm = MovingArm(model, true_unknowns(model, seed, share=0.2 * wrong), seed)
    estimator = TipEstimator(model, TipEstimatorConfig(test_after=10000, test_at_latest=1000.0))
    memory = estimator.layout.view(np.zeros(estimator.layout.size))
    estimator.start(memory)
    rng, off, kept = np.random.default_rng(seed), np.zeros(6), np.exp(-PERIOD / LASTS)
    for k in range(round(duration / PERIOD)):
        off = kept * off + np.sqrt(1.0 - kept**2) * wrong * OFF * rng.normal(size=6)
        pair = arm.pair(PERIOD * k, noise=wrong)._replace(time=PERIOD * k)
        x = estimator.x(memory)
        J = model.jacobian(estimator.constants(memory), x, pair.theta)
        estimator.add(memory, pair._replace(X_WE=moved(pair.X_WE[None], (J @ off)[None])[0]))
        estimator.work(memory)
    return estimator, memory, arm


def squares(estimator: TipEstimator, memory, arm: MovingArm, times: np.ndarray) -> list[float]:
    """Squares of what the model of the tip is off by, in what it says that it may be."""
    found = []
    for time in times:
        pair = arm.pair(time, noise=0.0)
        tip = estimator.predict(memory, pair)
        error = pose_error(pair.X_WE, tip.X_WE[0])
        covariance = tip.H[0] @ estimator.covariance(memory) @ tip.H[0].T
        found.append(float(error @ np.linalg.solve(covariance + (1e-6) ** 2 * np.eye(6), error)))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("is_said", "least", "most"), [(True, 2.0, 8.0), (False, 9.0, np.inf)])
def test_teeth_that_wander_make_a_robot_no_better_known_than_it_is(is_said, least, most):
    """Chi squared of six has a mean of six; noise that lasts and is taken for white makes that far more."""
    found = []
    for seed in range(6):
        model = said(tip_model(gear_error=5e-5), OFF**2 if is_said else np.zeros(6))
        found += squares(*learnt(model, seed, 4.0), np.linspace(3.0, 4.0, 10))
    assert least < np.mean(found) < most


@pytest.mark.parametrize("spread", [5e-5, 0.0])  # rad, of gear errors
def test_what_samples_said_is_the_same_where_it_is_read_again(spread):
    """But for what motion there is in a keyframe; the arm is as it is believed, so nothing else changes."""
    model = tip_model(gear_error=spread)
    estimator, memory, _ = learnt(said(model, OFF**2) if spread else model, 0, 2.0, wrong=0.0)
    past = memory.keyframes
    if memory.samples[0]:
        estimator._close(memory)
    before = past.A.copy()
    past.xi_pass[:], past.position[0] = np.inf, -1.0
    for _ in range(1000):
        estimator.work(memory)
    assert past.position[0] < 0.0
    smooth = slice(0, model.E.start)  # waves of gears turn in a keyframe
    scale = np.sqrt(np.outer(before.diagonal(), before.diagonal()))[smooth, smooth]
    np.testing.assert_allclose(past.A[smooth, smooth] / scale, before[smooth, smooth] / scale, atol=0.01)

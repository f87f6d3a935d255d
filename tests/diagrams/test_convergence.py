"""The shipped integrator settings against accurate ones: the tip is right to less than a micrometre."""

import numpy as np
import pytest

from diagrams.runs.simulation import Experiment
from tests.diagrams.rigs import LAWS, QUIET, scenario

FAST = [
    "reference.settle=0",
    "reference.acceleration=3",
    *QUIET,
]  # motion from the start, no noise to amplify
ACCURATE = {
    "runge_kutta3": ["integrator.accuracy=1.0e-8", "integrator.max_step=0.001"],
    # An unloaded wrist is so stiff that 1e-8 takes minutes; the third order makes this as good.
    "radau3": ["integrator.accuracy=1.0e-6", "integrator.max_step=0.00025"],
}


def tips(law: str, duration: float, *settings: str) -> np.ndarray:
    experiment = Experiment(scenario("misaligned", *settings), law)
    experiment.advance(duration)
    return experiment.log().X_WE_true[:, :3, 3]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "payload", "scheme"),
    [*((law, 7.0, "runge_kutta3") for law in LAWS), ("numerical_ik", 0.0, "radau3")],
)
def test_more_accuracy_moves_the_tip_by_less_than_a_micrometre(law: str, payload: float, scheme: str):
    load = f"station.payload={payload}"
    found = tips(law, 0.4, *FAST, load)
    accurate = tips(law, 0.4, *FAST, load, f"integrator.scheme={scheme}", *ACCURATE[scheme])
    assert np.ptp(found, axis=0).max() > 5e-3  # it has moved
    error = np.linalg.norm(found - accurate, axis=1).max()
    assert error < 1e-6


@pytest.mark.slow
def test_a_stiff_loop_is_right_to_a_tenth_of_a_micrometre_with_a_noisy_camera():
    duration, scheme = 0.3, "radau3"
    found, accurate = tips("pbvs", duration), tips("pbvs", duration, *ACCURATE[scheme])
    assert np.linalg.norm(found - accurate, axis=1).max() < 1e-7

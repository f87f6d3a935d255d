"""Explanations of a step are held against each other, also where one of them explains nothing."""

import numpy as np
from scipy.spatial.transform import Rotation

from systems.estimation.camera.displacement import Displacement
from systems.estimation.events import TOOL_DISPLACED

SIGMA, SIZE = 1e-4, 8  # rad and m, of a sample; unknowns, the last four of the load


def test_a_load_that_bends_nothing_is_no_explanation_and_no_division_by_zero():
    rng, displacement = np.random.default_rng(1), Displacement(SIZE, slice(4, 8))
    memory = displacement.layout.view(np.zeros(displacement.layout.size))
    for _ in range(2):
        displacement.keep(memory, np.eye(SIZE), np.zeros(SIZE))
    assert displacement.begin(memory)
    found = None
    while found is None and memory.samples[0]:
        H = np.hstack((1e-4 * rng.normal(size=(6, 4)), np.zeros((6, 4))))
        X_WE = np.eye(4)
        X_WE[:3, :3], X_WE[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
        r = np.concatenate((np.zeros(3), X_WE[:3, :3] @ [5e-4, 0.0, 0.0])) + SIGMA * rng.normal(size=6)
        columns = H, rng.normal(size=(6, 6))
        found = displacement.found(memory, r, columns, X_WE, np.full(6, SIGMA**-2))
    assert found == TOOL_DISPLACED
    np.testing.assert_allclose(displacement.size(memory, found, X_WE[:3, 3]), 5e-4, rtol=0.2)
    assert np.isfinite(memory.fits).all()

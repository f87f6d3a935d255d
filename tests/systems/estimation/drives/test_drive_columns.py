"""No two things share a place in the regression of drives, and none is left over."""

import numpy as np
import pytest

from systems.estimation.drives.drive_model import DriveModel
from systems.estimation.kernels import drive_columns as at
from tests.systems.estimation.drives.motors import drives

STILL = np.zeros(6)


def equations(row: int | None, v: float = 0.0, a: float = 0.0) -> np.ndarray:
    """Those of a motion, (6, 75), with a regressor that is one, or none."""
    model: DriveModel = drives()[0]
    regressors = np.zeros((at.NUM_ROWS, 6))
    if row is not None:
        regressors[row] = 1.0
    return model.features(STILL + v, STILL + a, regressors)


@pytest.mark.slow
def test_each_parameter_stands_for_one_regressor_for_motion_or_for_a_constant():
    """The rate of a command counts as speed does."""
    constant = equations(None)
    parts = [equations(row) - constant for row in range(at.NUM_ROWS) if row != at.ROW_RATE]
    parts += [equations(None, v=1.0) - constant, equations(None, a=1.0) - constant, constant]
    seen = np.array([(part != 0.0).any(axis=0) for part in parts])
    np.testing.assert_array_equal(seen.sum(axis=0), np.ones(at.SIZE))
    assert seen.any(axis=1).all()
    np.testing.assert_array_equal(equations(at.ROW_RATE), equations(None, v=1.0))


@pytest.mark.slow
def test_what_a_joint_has_of_its_own_stands_in_its_equation_alone():
    """Dead time, load, smoothing and other gains are those of all joints."""
    motion = np.sum([equations(row, v=1.0, a=1.0) for row in range(at.NUM_ROWS)], axis=0) != 0.0
    shared = np.flatnonzero(motion.sum(axis=0) == 6)
    of_all = [at.DEAD_TIME, *range(at.MASS, at.SMOOTHED + 1), *range(at.OTHER_GAINS, at.THIRD)]
    np.testing.assert_array_equal(shared, of_all)
    assert (np.delete(motion.sum(axis=0), shared) == 1).all()

"""Random errors: within their bounds, the same for the same seed, on top of those that are given."""

import numpy as np
import pytest

from robots.description.error_parameters import error_parameters
from robots.description.geometric_errors import GeometricErrors, RandomErrors
from robots.description.model import load_robot

ROBOT = load_robot("irb1200")
UNITS = np.array([parameter.unit for parameter in error_parameters(ROBOT)])


def drawn(seed: int) -> np.ndarray:
    return RandomErrors(seed, translation_mm=6.0, rotation_deg=0.9).vector(ROBOT)


@pytest.mark.slow
def test_draws_fill_their_bounds_evenly():
    """1000 robots of 48 errors: the spread of a uniform draw is its bound over the root of three."""
    errors = np.array([drawn(seed) for seed in range(1000)])
    for unit, bound in (("m", 6e-3), ("rad", np.deg2rad(0.9))):
        part = errors[:, unit == UNITS]
        assert 0.99 * bound < np.abs(part).max() <= bound
        assert part.std() == pytest.approx(bound / np.sqrt(3.0), rel=0.02)


def test_a_seed_is_a_robot():
    assert np.array_equal(drawn(3), drawn(3))
    assert not np.array_equal(drawn(3), drawn(4))


def test_random_errors_come_on_top_of_given_ones():
    given = GeometricErrors(joint_offset_deg=np.arange(6.0))
    both = GeometricErrors(joint_offset_deg=np.arange(6.0), random=RandomErrors(3, 6.0, 0.9))
    np.testing.assert_allclose(both.vector(ROBOT) - given.vector(ROBOT), drawn(3), atol=1e-15)


def test_refuses_negative_bounds():
    with pytest.raises(ValueError, match=r"translation_mm must be finite and not negative, got -1"):
        RandomErrors(translation_mm=-1.0).vector(ROBOT)

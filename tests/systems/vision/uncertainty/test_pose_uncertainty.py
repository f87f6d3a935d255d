"""A budget of uncertainty is what a simulation of all its causes shows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from systems.vision.camera_rig import load_cell
from systems.vision.marker_body import load_body
from systems.vision.uncertainty.pose_uncertainty import (
    CAMERAS,
    IMAGES,
    TEMPERATURE,
    TIME,
    TOOL,
    MeasuredPose,
    Uncertainties,
    covariances,
)
from systems.vision.uncertainty.simulated_poses import simulated_errors

CELL, BODY = load_cell("probst"), load_body("probst")
RIG = CELL.camera_model()
ANCHOR = RIG.p_WC.mean(axis=0) * [1.0, 1.0, 0.0]
NOTHING = Uncertainties(**dict.fromkeys(Uncertainties.__dataclass_fields__, 0.0))
ALONE = {
    IMAGES: replace(NOTHING, pixel=0.1),
    CAMERAS: replace(NOTHING, camera_position=5e-5, camera_rotation=1e-5),
    TOOL: replace(NOTHING, tool_position=2e-5, tool_rotation=5e-5),
    TIME: replace(NOTHING, time_stamp=1e-4),
    TEMPERATURE: replace(NOTHING, temperature=2.0, frame_expansion=1.2e-5, body_expansion=2.3e-5),
}


def place(x: float = 0.6, speed: float = 0.53) -> MeasuredPose:
    X = np.eye(4)
    X[:3, :3] = Rotation.from_rotvec([0.3, 2.0, -0.4]).as_matrix()
    X[:3, 3] = x, 0.1, 0.5
    seen = np.ones((len(RIG), len(BODY)), bool)
    seen[::3, ::2] = False
    return MeasuredPose(X, np.array([0.2, 0.0, 0.1, speed, 0.0, 0.0]), seen)


@pytest.mark.parametrize("cause", ALONE)
def test_each_cause_alone_spreads_poses_as_the_budget_says(cause: str):
    """400 draws know a standard deviation to 4 %; no axis is off by more than a tenth of the largest one."""
    found = covariances(RIG, BODY.p_E, ANCHOR, place(), ALONE[cause])
    drawn = simulated_errors(RIG, BODY.p_E, ANCHOR, place(), ALONE[cause], 400, np.random.default_rng(1))
    for part in (slice(0, 3), slice(3, 6)):
        expected = np.sqrt(np.diag(found[cause])[part])
        spread = np.sqrt(np.mean(drawn[:, part] ** 2, axis=0))
        np.testing.assert_allclose(spread, expected, atol=0.1 * expected.max())
    for other in set(ALONE) - {cause}:
        assert not found[other].any()


def test_all_causes_together_spread_poses_as_their_sum():
    given = Uncertainties()
    parts = covariances(RIG, BODY.p_E, ANCHOR, place(), given)
    total = np.sum(list(parts.values()), axis=0)
    drawn = simulated_errors(RIG, BODY.p_E, ANCHOR, place(), given, 400, np.random.default_rng(2))
    expected = np.sqrt(np.trace(total[3:, 3:]))
    assert np.sqrt(np.mean(np.sum(drawn[:, 3:] ** 2, axis=1))) == pytest.approx(expected, rel=0.1)


def test_a_millisecond_at_half_a_metre_a_second_is_half_a_millimetre():
    given = replace(NOTHING, time_stamp=1e-3)
    found = covariances(RIG, BODY.p_E, ANCHOR, place(speed=0.53), given)
    assert np.sqrt(found[TIME][3, 3]) == pytest.approx(0.53e-3)


def test_a_pose_that_is_not_seen_has_no_uncertainty():
    blind = replace(place(), seen=np.zeros((len(RIG), len(BODY)), bool))
    found = covariances(RIG, BODY.p_E, ANCHOR, blind, Uncertainties())
    assert all(np.isnan(part).all() for part in found.values())


def test_an_uncertainty_below_zero_is_refused():
    with pytest.raises(ValueError, match=r"uncertainty pixel must be zero or positive, got -0\.1"):
        Uncertainties(pixel=-0.1)

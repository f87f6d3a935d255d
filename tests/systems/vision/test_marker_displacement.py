"""A bent arm and a lost sphere are named by their marker, and noise by none."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from systems.vision.camera_rig import load_cell
from systems.vision.marker_body import load_body
from systems.vision.marker_displacement import check_markers

RIG, BODY = load_cell("probst").camera_model(), load_body("probst")
SIGMA = 0.02  # px, of the mean of 25 images
ALL = np.ones((3, len(RIG), len(BODY)), bool)


def poses() -> np.ndarray:
    X = np.tile(np.eye(4), (3, 1, 1))
    X[:, :3, :3] = Rotation.from_rotvec([[0, 2.0, 0], [0.5, 1.5, 0.3], [-0.4, 2.2, 0.6]]).as_matrix()
    X[:, :3, 3] = [0.5, 0.1, 0.5], [0.6, -0.1, 0.6], [0.4, 0.0, 0.4]
    return X


def images(bent: dict[int, np.ndarray], seed: int) -> np.ndarray:
    """Of a body whose arms are bent, by poses that are a little off, as a fit of it would be."""
    p_E = BODY.p_E.copy()
    for marker, shift in bent.items():
        p_E[marker] += shift
    X = poses()
    seen = np.array([RIG.project(p_E @ x[:3, :3].T + x[:3, 3] + 5e-5) for x in X])
    return seen + SIGMA * np.random.default_rng(seed).standard_normal(seen.shape)


@pytest.mark.parametrize("marker", range(len(BODY)))
def test_a_bent_arm_is_named_with_its_displacement(marker: int):
    """0.1 mm; the standard deviation covers what is found."""
    shift = 1e-4 * Rotation.from_rotvec([0.3 * marker, 1.0, -0.5]).apply([1.0, 0.0, 0.0])
    (change,) = check_markers(RIG, BODY.p_E, poses(), images({marker: shift}, marker), SIGMA, ALL).changes
    assert change.marker == marker
    assert not change.is_lost
    assert np.linalg.norm(change.displacement - shift) < 5.0 * change.sigma
    assert change.sigma < 1e-5


def test_noise_names_nobody():
    for seed in range(20):
        found = check_markers(RIG, BODY.p_E, poses(), images({}, seed), SIGMA, ALL)
        assert not found.changes
        assert abs(found.misfit) < 4.0


def test_a_sphere_that_no_camera_sees_is_lost_and_one_that_is_hidden_is_not():
    pixels = images({}, 1)
    pixels[:, :, 4] = np.nan
    expected = ALL.copy()
    expected[:, :, 7] = False
    pixels[:, :, 7] = np.nan
    (change,) = check_markers(RIG, BODY.p_E, poses(), pixels, SIGMA, expected).changes
    assert change.marker == 4
    assert change.is_lost


def test_a_body_that_is_bent_at_two_arms_is_not_blamed_on_one():
    bent = {2: np.array([3e-4, 0, 0]), 8: np.array([0, 3e-4, 0])}
    found = check_markers(RIG, BODY.p_E, poses(), images(bent, 3), SIGMA, ALL)
    assert not found.changes
    assert found.misfit > 50.0


def test_images_without_noise_are_refused():
    with pytest.raises(ValueError, match=r"pixel_sigma must be positive, got 0\.0 px"):
        check_markers(RIG, BODY.p_E, poses(), images({}, 1), 0.0, ALL)

"""Orientations, pose errors and their rates: against scipy, finite differences and closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from robots.pose import (
    angular_velocity,
    euler_difference,
    euler_rate_matrix,
    euler_rates,
    pose_error,
    rotation_from_zyx,
    rotation_vector,
    sine_error_rate_matrix,
    sine_pose_error,
    wrap_angle,
    zyx_from_rotation,
)

ROUNDING = 1e-14  # a few dozen operations on numbers of order one
DIFFERENCES = 1e-8  # central differences: h^2 / 6 times the third derivative, at most 5 cubed here
STEP = 1e-5


def rotations(n: int, seed: int = 0) -> np.ndarray:
    return Rotation.from_quat(np.random.default_rng(seed).normal(size=(n, 4))).as_matrix()


def poses(n: int, seed: int) -> np.ndarray:
    X = np.tile(np.eye(4), (n, 1, 1))
    X[:, :3, :3] = rotations(n, seed)
    X[:, :3, 3] = np.random.default_rng(seed).normal(size=(n, 3))
    return X


def turned(R: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return Rotation.from_rotvec(vector).as_matrix() @ R


def test_zyx_angles_are_scipys_intrinsic_zyx():
    angles = np.random.default_rng(1).uniform(-1.5, 1.5, (200, 3))
    assert rotation_from_zyx(angles) == pytest.approx(
        Rotation.from_euler("ZYX", angles).as_matrix(), abs=ROUNDING
    )
    assert zyx_from_rotation(rotation_from_zyx(angles)) == pytest.approx(
        angles, abs=1e-13
    )  # beta is near 86 deg


@pytest.mark.parametrize(
    "beta", [np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-8, np.pi / 2 - 1e-10, np.pi / 2 - 1e-13]
)
def test_zyx_angles_reproduce_the_rotation_in_and_around_gimbal_lock(beta: float):
    R = rotation_from_zyx(np.array([[0.7, beta, -1.9], [3.0, beta, 2.0]]))
    assert rotation_from_zyx(zyx_from_rotation(R)) == pytest.approx(R, abs=2e-13)


def test_gamma_is_zero_in_gimbal_lock():
    zyx = zyx_from_rotation(rotation_from_zyx(np.array([0.7, np.pi / 2, 0.4])))
    assert zyx == pytest.approx([0.3, np.pi / 2, 0.0], abs=ROUNDING)


@given(st.lists(st.floats(-np.pi, np.pi), min_size=3, max_size=3))
def test_zyx_round_trip_of_any_rotation(angles: list[float]):
    R = rotation_from_zyx(np.array(angles))
    assert rotation_from_zyx(zyx_from_rotation(R)) == pytest.approx(R, abs=2e-13)


def test_euler_rate_matrix_maps_angle_rates_to_the_angular_velocity():
    rng = np.random.default_rng(2)
    for zyx, rates in zip(rng.uniform(-1.4, 1.4, (50, 3)), rng.normal(size=(50, 3)), strict=True):
        after, before = rotation_from_zyx(zyx + STEP * rates), rotation_from_zyx(zyx - STEP * rates)
        w = rotation_vector(after @ before.T) / (2.0 * STEP)
        assert euler_rate_matrix(zyx) @ rates == pytest.approx(w, abs=DIFFERENCES)


@pytest.mark.parametrize(
    "angle", [0.0, 1e-12, 1e-9, 1e-6, 1.0, 2.0, 3.0, np.pi - 1e-2, np.pi - 1e-6, np.pi - 1e-9]
)
def test_rotation_vector_is_accurate_for_every_angle(angle: float):
    axes = np.random.default_rng(3).normal(size=(100, 3))
    vectors = angle * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    R = Rotation.from_rotvec(vectors).as_matrix()
    singles = np.array([rotation_vector(one) for one in R])
    # Relative to the angle; rounding grows by the inverse of the sine, up to 1e2.
    assert np.abs(rotation_vector(R) - vectors).max() <= 1e-13 * angle
    assert np.abs(singles - vectors).max() <= 1e-13 * angle


@pytest.mark.parametrize("axis", [[1.0, 0, 0], [0, 1.0, 0], [0, 0, -1.0], [0.6, 0, -0.8], [-0.48, 0.6, 0.64]])
def test_half_a_turn_is_found_up_to_its_sign(axis: list[float]):
    R = 2.0 * np.outer(axis, axis) - np.eye(3)
    vector = rotation_vector(R)
    assert np.linalg.norm(vector) == pytest.approx(np.pi)
    assert np.abs(vector @ axis) == pytest.approx(np.pi)


def test_pose_error_is_the_turn_and_the_way_to_the_wanted_pose():
    X_WD, X_WE = poses(200, 4), poses(200, 5)
    error = pose_error(X_WD, X_WE)
    assert turned(X_WE[:, :3, :3], error[:, :3]) == pytest.approx(X_WD[:, :3, :3], abs=1e-13)
    assert X_WE[:, :3, 3] + error[:, 3:] == pytest.approx(X_WD[:, :3, 3], abs=ROUNDING)


def test_sine_error_has_the_sine_of_the_angle_in_its_place():
    X_WD, X_WE = poses(200, 6), poses(200, 7)
    error, sine_error = pose_error(X_WD, X_WE), sine_pose_error(X_WD, X_WE)
    angle = np.linalg.norm(error[:, :3], axis=1, keepdims=True)
    assert sine_error[:, :3] == pytest.approx(error[:, :3] / angle * np.sin(angle), abs=1e-13)
    assert np.array_equal(sine_error[:, 3:], error[:, 3:])


def test_a_single_pose_gives_what_a_batch_gives():
    X_WD, X_WE = poses(300, 8), poses(300, 9)
    half_turn = np.diag([1.0, -1.0, -1.0, 1.0])
    X_WD[0], X_WE[0] = half_turn, np.eye(4)
    zyx = zyx_from_rotation(X_WD[:, :3, :3])
    # Rounding differs, and near half a turn the inverse of the sine makes it larger, by up to 1e2.
    for function, batch in [
        (pose_error, (X_WD, X_WE)),
        (sine_pose_error, (X_WD, X_WE)),
        (sine_error_rate_matrix, (X_WD[:, :3, :3], X_WE[:, :3, :3])),
        (rotation_vector, (X_WD[:, :3, :3],)),
        (zyx_from_rotation, (X_WD[:, :3, :3],)),
        (rotation_from_zyx, (zyx,)),
        (euler_rate_matrix, (zyx,)),
    ]:
        singles = np.array([function(*arguments) for arguments in zip(*batch, strict=True)])
        assert function(*batch) == pytest.approx(singles, abs=1e-13), function.__name__


def test_euler_rates_and_angular_velocity_are_the_rate_matrix_and_its_inverse():
    rng = np.random.default_rng(13)
    for zyx, rates in zip(rng.uniform(-1.5, 1.5, (100, 3)), rng.normal(size=(100, 3)), strict=True):
        w = angular_velocity(zyx, rates)
        assert w == pytest.approx(euler_rate_matrix(zyx) @ rates, abs=1e-13)
        # The inverse grows with 1 / cos(beta), here up to 14.
        assert euler_rates(zyx, w) == pytest.approx(rates, abs=1e-12)


def test_euler_differences_take_the_short_way_round():
    wanted, seen = (np.deg2rad([alpha, 10.0, 90.0]).tolist() for alpha in (179.0, -178.0))
    assert np.rad2deg(euler_difference(wanted, seen)) == pytest.approx([-3.0, 0.0, 0.0], abs=1e-12)


def test_rate_of_the_sine_error_against_finite_differences():
    """The corrected L_O of Probst (2024) eqs. (2.41) to (2.46)."""
    rng = np.random.default_rng(10)
    for X_WD, X_WE in zip(poses(200, 11), poses(200, 12), strict=True):
        w_D, w_E = rng.normal(size=(2, 3))
        ends = []
        for h in (STEP, -STEP):
            D, E = X_WD.copy(), X_WE.copy()
            D[:3, :3], E[:3, :3] = turned(D[:3, :3], h * w_D), turned(E[:3, :3], h * w_E)
            ends.append(sine_pose_error(D, E)[:3])
        L = sine_error_rate_matrix(X_WD[:3, :3], X_WE[:3, :3])
        assert L.T @ w_D - L @ w_E == pytest.approx((ends[0] - ends[1]) / (2.0 * STEP), abs=DIFFERENCES)


@given(st.floats(-np.pi, np.pi), st.integers(0, 1000))
def test_determinant_of_the_rate_matrix_depends_on_the_angle_only(angle: float, seed: int):
    R_WE = rotations(1, seed)[0]
    axis = np.random.default_rng(seed).normal(size=3)
    R_WD = turned(R_WE, angle * axis / np.linalg.norm(axis))
    closed_form = np.cos(angle) * (1.0 + np.cos(angle)) / 2.0  # zero at 90 and 180 degrees
    assert np.linalg.det(sine_error_rate_matrix(R_WD, R_WE)) == pytest.approx(closed_form, abs=ROUNDING)


@pytest.mark.parametrize("degrees", [90.0, 180.0])
def test_rate_matrix_is_singular_at_a_quarter_and_at_half_a_turn(degrees: float):
    R_WD = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    assert np.linalg.svd(sine_error_rate_matrix(R_WD, np.eye(3)))[1].min() < 1e-15
    assert sine_error_rate_matrix(np.eye(3), np.eye(3)) == pytest.approx(np.eye(3))


@given(st.floats(-1e4, 1e4))
def test_wrapped_angles_are_the_same_angle_in_one_turn(angle: float):
    wrapped = wrap_angle(np.array([angle]))[0]
    assert -np.pi < wrapped <= np.pi
    # Rounding of 1e4 rad is 2e-12.
    assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * angle), abs=1e-11)


@given(st.floats(-3.14159, np.pi))
def test_angles_within_one_turn_are_left_as_they_are(angle: float):
    assert wrap_angle(np.array(angle)) == angle


def test_half_a_turn_backward_becomes_half_a_turn_forward():
    assert np.array_equal(wrap_angle(np.array([-np.pi, np.pi, 3.0 * np.pi])), [np.pi] * 3)

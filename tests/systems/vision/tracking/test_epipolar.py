"""Epipolar geometry: the point that one camera sees lies on a line in the image of another."""

import cv2
import numpy as np

from systems.vision.tracking.epipolar import (
    epipolar_distances,
    epipolar_lines,
    fundamental_matrices,
    homogeneous,
)
from tests.systems.vision.rigs import random_cameras

RNG = np.random.default_rng(1)
CAMERAS = random_cameras(RNG, 5)
POINTS = RNG.uniform(-0.4, 0.4, (30, 3))
PIXELS = CAMERAS.undistort(CAMERAS.project(POINTS))
F = fundamental_matrices(CAMERAS)
PAIRS = [(i, j) for i in range(5) for j in range(5) if i != j]


def test_images_of_a_point_fulfil_the_epipolar_condition_in_every_pair():
    for i, j in PAIRS:
        lines = epipolar_lines(F[i, j], PIXELS[i])
        on_line = np.einsum("ka,ka->k", lines, homogeneous(PIXELS[j]))
        np.testing.assert_allclose(on_line, 0.0, atol=1e-7)  # px; pixels are thousands


def test_the_way_back_is_the_transposed_matrix():
    """Probst (2024), eq. (3.20), with its vector in the frame of the first camera."""
    scale = np.abs(F).max()
    for i, j in PAIRS:
        np.testing.assert_allclose(F[j, i], F[i, j].T, atol=1e-14 * scale)


def test_lines_are_those_of_opencv():
    for i, j in PAIRS:
        theirs = cv2.computeCorrespondEpilines(PIXELS[i], 1, F[i, j])[:, 0]
        np.testing.assert_allclose(epipolar_lines(F[i, j], PIXELS[i]), theirs, rtol=1e-9, atol=1e-9)


def test_distances_are_measured_in_pixels_across_the_line():
    i, j = 0, 1
    lines = epipolar_lines(F[i, j], PIXELS[i])
    moved = PIXELS[j] + 3.0 * lines[:, :2]  # (a, b) of a line a u + b v + c is its unit normal
    distance = np.diagonal(epipolar_distances(F[i, j], PIXELS[i], moved))
    across = np.einsum("ka,ka->k", lines, homogeneous(moved))
    np.testing.assert_allclose(across, 3.0, atol=1e-6)
    assert np.all(distance >= 3.0 - 1e-6)
    assert epipolar_distances(F[i, j], PIXELS[i], PIXELS[j]).shape == (30, 30)
    np.testing.assert_allclose(np.diagonal(epipolar_distances(F[i, j], PIXELS[i], PIXELS[j])), 0.0, atol=1e-6)

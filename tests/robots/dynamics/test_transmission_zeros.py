"""Zeros of mechanical systems: closed forms, an independent pencil, published figures, what robots have."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eig

from robots.description.model import load_robot
from robots.dynamics.transmission_zeros import ZeroAnalysis, transmission_zeros

BENT = np.array([0.0, -1.2, 1.0, 0.0, 0.7, 0.0])


def rosenbrock_zeros(M, D, K, B, C) -> np.ndarray:
    """The same zeros from the system pencil [[A - s I, B], [C, 0]] of the state space."""
    n, p = B.shape
    M_inverse = np.linalg.inv(M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-M_inverse @ K, -M_inverse @ D]])
    inputs = np.vstack([np.zeros((n, p)), M_inverse @ B])
    pencil = np.block([[A, inputs], [np.hstack([C, np.zeros((p, n))]), np.zeros((p, p))]])
    weights = np.zeros_like(pencil)
    weights[: 2 * n, : 2 * n] = np.eye(2 * n)
    values = np.asarray(eig(pencil, weights, right=False))
    return values[np.isfinite(values) & (np.abs(values) < 1e5)]


def test_two_masses_and_a_spring():
    """Force on the first: its own motion has the zeros of the second swinging alone, the other's has none."""
    m, k = 2.0, 50.0
    M, D, K = np.diag([3.0, m]), np.zeros((2, 2)), k * np.array([[1.0, -1.0], [-1.0, 1.0]])
    force, first, second = np.array([[1.0], [0.0]]), np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])
    collocated = transmission_zeros(M, D, K, force, first)
    assert np.sort(np.imag(collocated.values)) == pytest.approx([-np.sqrt(k / m), np.sqrt(k / m)])
    assert collocated.relative_degree == 2
    assert collocated.is_minimum_phase
    across = transmission_zeros(M, D, K, force, second)
    assert len(across.values) == 0
    assert across.relative_degree == 4


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(3, 7), p=st.integers(1, 2))
def test_the_reduced_problem_has_the_zeros_of_the_system_pencil(seed: int, n: int, p: int):
    rng = np.random.default_rng(seed)
    square = rng.standard_normal((3, n, n))
    M, D, K = square @ square.swapaxes(1, 2) + 0.5 * np.eye(n)
    B, C = rng.standard_normal((n, p)), rng.standard_normal((p, n))
    found, expected = transmission_zeros(M, D, K, B, C).values, rosenbrock_zeros(M, D, K, B, C)
    assert len(found) == 2 * (n - p)
    for value in found:
        # Random outputs can come near to dependent ones, which costs the pencil digits.
        assert np.abs(expected - value).min() < 1e-5 * (1.0 + abs(value))


@pytest.mark.parametrize(("name", "payload"), [("kr16", 16.0), ("kr210", 210.0), ("irb1200", 7.0)])
def test_gears_alone_have_a_stable_inverse_and_a_structure_has_none(name: str, payload: float):
    robot = load_robot(name)
    gears = ZeroAnalysis(robot, "joints", payload).at(BENT)
    # Each link follows its gear by one zero at -c/d: three derivatives of each of the six outputs.
    ratio = [-joint.drive_train.stiffness / joint.drive_train.damping for joint in robot.joints]
    assert np.real(gears.values) == pytest.approx(np.sort(ratio), rel=1e-3)
    assert gears.relative_degree == 18
    structure = ZeroAnalysis(robot, "structure", payload).at(BENT)
    assert structure.slowest_rhp is not None


def test_a_singular_wrist_and_wrong_shapes_are_refused():
    with pytest.raises(ValueError, match="singular with the motors at"):
        ZeroAnalysis(load_robot("irb1200")).at(np.zeros(6))
    eye = np.eye(2)
    with pytest.raises(ValueError, match="C 1 x 2 for B of 2 x 1"):
        transmission_zeros(eye, eye, eye, np.ones((2, 1)), np.ones((2, 2)))
    with pytest.raises(ValueError, match="the inputs depend on each other"):
        transmission_zeros(eye, eye, eye, np.ones((2, 2)), eye)

"""Two joints, the second one sprung, Reiner (2010) section 3.5.2: what figure 3.10 shows."""

import numpy as np
import pytest

from experiments.feedforward.two_joint_arm import (
    ANGLE,
    DAMPING,
    FAR,
    INERTIA,
    LENGTH,
    MASS,
    NEAR,
    PATH,
    PERIOD,
    SHARE,
    STIFFNESS,
    TIMES,
    TwoJointArm,
    driven_joint,
)

ARM = TwoJointArm()
RIGID, APPROXIMATE, EXACT = ARM.rigid(), ARM.approximate(), ARM.exact()


def largest(values: np.ndarray) -> float:
    return float(np.abs(values).max())


def test_the_section_torque_of_the_rigid_arm_is_that_of_the_source():
    """(3.41a): (J_z + m l^2 - m l^2 xi) times the angular acceleration."""
    phi2 = np.array([driven_joint(time, 0.0, 0.0, 0.0)[2] for time in TIMES])
    expected = (INERTIA + MASS * LENGTH**2 * (1.0 - SHARE)) * phi2
    np.testing.assert_allclose(RIGID.section, expected, atol=1e-6)


def test_every_solution_has_the_point_on_its_path():
    for solution in (RIGID, APPROXIMATE, EXACT):
        y = FAR * np.sin(solution.angle + solution.deflection) + NEAR * np.sin(solution.angle)
        np.testing.assert_allclose(y, PATH(TIMES), atol=1e-12)
        assert y[-1] == pytest.approx(LENGTH * np.sin(ANGLE))


def test_the_exact_solution_balances_the_spring():
    """Its section torque is that of spring and damper, with differences for the rate."""
    rate = np.gradient(EXACT.deflection, PERIOD, edge_order=2)
    carried = -STIFFNESS * EXACT.deflection - DAMPING * rate
    # Of 2 kN m; differences over a millisecond of what rings with some hundred 1/s.
    np.testing.assert_allclose(EXACT.section, carried, atol=0.5)


def left(name: str) -> float:
    """The share of the rigid arm's largest error that the approximation leaves."""
    goal = getattr(EXACT, name)
    return largest(getattr(APPROXIMATE, name) - goal) / largest(getattr(RIGID, name) - goal)


def test_the_approximation_is_far_nearer_to_the_exact_inverse_than_the_rigid_one():
    """Angles to a thousandth of what the rigid arm misses; as in the source, torques are not so near."""
    assert left("angle") < 1e-3
    assert left("deflection") < 1e-3
    assert 1e-3 < left("section") < 0.1
    assert 1e-3 < left("torque") < 0.1


def test_the_size_of_things():
    """The spring bends by milliradians; the driven joint turns back by the share of the lever behind it."""
    assert 1e-3 < largest(EXACT.deflection) < 1e-2
    ratio = largest(EXACT.angle - RIGID.angle) / largest(EXACT.deflection)
    assert ratio == pytest.approx(FAR / LENGTH, rel=0.01)
    assert largest(EXACT.section) == pytest.approx(STIFFNESS * largest(EXACT.deflection), rel=1e-3)


def test_the_rows_of_drake_are_those_of_the_source():
    """(3.36): mass matrix and centrifugal terms, at any angles."""
    a, e = 0.4, 0.7
    m, length, xi, J = MASS, LENGTH, SHARE, INERTIA
    M_11 = m * length**2 - 2 * m * xi**2 * length**2 * np.cos(e) + 2 * m * length**2 * xi * np.cos(e)
    M_11 += -2 * m * xi * length**2 + 2 * m * xi**2 * length**2 + J
    M_12 = J - 2 * m * xi * length**2 + m * length**2 * xi * np.cos(e) - m * xi**2 * length**2 * np.cos(e)
    M_12 += m * xi**2 * length**2 + m * length**2
    M_22 = J + m * xi**2 * length**2 - 2 * m * xi * length**2 + m * length**2
    a1, e1, acceleration = 1.1, -0.6, np.array([0.3, -2.0])
    h = np.sin(e) * m * length**2 * xi * (1 - xi) * np.array([-e1 * (e1 + 2 * a1), a1**2])
    expected = np.array([[M_11, M_12], [M_12, M_22]]) @ acceleration + h
    found = ARM.torques(np.array([a, e]), np.array([a1, e1]), acceleration)
    np.testing.assert_allclose(found, expected, rtol=1e-12)

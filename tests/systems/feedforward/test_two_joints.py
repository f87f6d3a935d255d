"""Two joints, the second one sprung, Reiner (2010) section 3.5.2: figure 3.10, rigid, approximate and exact.

The point that shall follow a path is the centre of mass, x_l = 0, where the exact inverse is stable.
"""

from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    MultibodyForces,
    RevoluteJoint,
    SpatialInertia,
    UnitInertia,
)
from scipy.integrate import solve_ivp

from robots.elastic_structure import massless
from systems.feedforward.sprung_deflection import SprungDeflection

LENGTH, SHARE, MASS, INERTIA = 2.0, 0.2, 100.0, 10.0  # m, -, kg, kg m^2
STIFFNESS, DAMPING = 1e6, 150.0  # N m / rad, N m s / rad
DURATION, PERIOD = 0.6, 1e-3  # s
ANGLE = 0.3  # rad, of the rigid robot at the end
# The tip's y from 0 to l sin(0.3) with four continuous derivatives.
RISE = LENGTH * np.sin(ANGLE)
PATH = RISE * Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])(Polynomial([0.0, 1.0 / DURATION]))
TIMES = np.arange(0.0, DURATION + 0.5 * PERIOD, PERIOD)
NEAR, FAR = LENGTH * SHARE, LENGTH * (1.0 - SHARE)  # m, of the first and the second bar


class Solution(NamedTuple):
    """What figure 3.10 shows, over TIMES."""

    angle: np.ndarray  # rad, of the driven joint
    deflection: np.ndarray  # rad, of the sprung joint
    torque: np.ndarray  # N m, of the driven joint
    section: np.ndarray  # N m, in the sprung joint


class Plant:
    """Both joints in Drake, without spring and damper."""

    def __init__(self) -> None:
        self.plant = MultibodyPlant(0.0)
        self.plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
        bar = self.plant.AddRigidBody("bar", massless())
        # The moments across z do not matter in the plane.
        unit = UnitInertia(INERTIA / MASS, INERTIA / MASS, INERTIA / MASS)
        inertia = SpatialInertia(MASS, np.zeros(3), unit).Shift(np.array([-FAR, 0.0, 0.0]))
        body = self.plant.AddRigidBody("body", inertia)
        z, end = np.array([0.0, 0.0, 1.0]), RigidTransform([NEAR, 0.0, 0.0])
        hinge = self.plant.AddFrame(FixedOffsetFrame("hinge", bar.body_frame(), end))
        self.plant.AddJoint(RevoluteJoint("driven", self.plant.world_frame(), bar.body_frame(), z))
        self.plant.AddJoint(RevoluteJoint("sprung", hinge, body.body_frame(), z))
        self.plant.Finalize()
        self.context, self.forces = self.plant.CreateDefaultContext(), MultibodyForces(self.plant)

    def torques(self, q: np.ndarray, v: np.ndarray, vdot: np.ndarray) -> np.ndarray:
        """(3.36) without the spring, both rows."""
        self.plant.SetPositionsAndVelocities(self.context, np.concatenate([q, v]))
        self.forces.SetZero()
        return self.plant.CalcInverseDynamics(self.context, vdot, self.forces)


PLANT = Plant()


def turned(y: float, rate: float, acceleration: float, e: float, e1: float, e2: float) -> np.ndarray:
    """The driven joint and its two derivatives from (3.37) for a deflection and its two derivatives."""
    # y = A sin(phi) + B cos(phi) with A = near + far cos(e), B = far sin(e)
    A, B = NEAR + FAR * np.cos(e), FAR * np.sin(e)
    phi = np.arcsin(y / np.hypot(A, B)) - np.arctan2(B, A)
    s, c, se, ce = np.sin(phi), np.cos(phi), np.sin(phi + e), np.cos(phi + e)
    lever = NEAR * c + FAR * ce
    phi1 = (rate - FAR * ce * e1) / lever
    phi2 = (acceleration - FAR * ce * e2 + NEAR * s * phi1**2 + FAR * se * (phi1 + e1) ** 2) / lever
    return np.array([phi, phi1, phi2])


def wanted(time: float) -> tuple[float, float, float]:
    return float(PATH(time)), float(PATH.deriv()(time)), float(PATH.deriv(2)(time))


def evaluated(e: np.ndarray, e1: np.ndarray, e2: np.ndarray) -> Solution:
    """The driven joint and all torques for a course of the deflection."""
    joint = np.array([turned(*wanted(t), a, b, c) for t, a, b, c in zip(TIMES, e, e1, e2, strict=True)])
    rows = [
        PLANT.torques(np.array([a[0], b[0]]), np.array([a[1], b[1]]), np.array([a[2], b[2]]))
        for a, b in zip(joint, np.stack([e, e1, e2], axis=1), strict=True)
    ]
    torque, section = np.array(rows).T
    return Solution(joint[:, 0], e, torque, section)


@cache
def rigid() -> Solution:
    zero = np.zeros(len(TIMES))
    return evaluated(zero, zero, zero)


@cache
def approximate() -> Solution:
    """Section torque of the rigid arm, (3.41), then the driven joint of the deformed one."""
    load = rigid().section
    spring = SprungDeflection(np.array([STIFFNESS]), np.array([DAMPING]), PERIOD)
    e = [spring.at_rest(load[:1])]
    for before, now in pairwise(load):
        e.append(spring.step(e[-1], np.array([before]), np.array([now])))
    deflection = np.array(e)[:, 0]
    rate = np.gradient(deflection, PERIOD, edge_order=2)
    return evaluated(deflection, rate, np.gradient(rate, PERIOD, edge_order=2))


@cache
def exact() -> Solution:
    """The second row of (3.36) with the driven joint of (3.37): a differential equation of the deflection."""

    def acceleration(time: float, e: float, e1: float) -> float:
        def residual(e2: float) -> float:
            phi, phi1, phi2 = turned(*wanted(time), e, e1, e2)
            row = PLANT.torques(np.array([phi, e]), np.array([phi1, e1]), np.array([phi2, e2]))[1]
            return row + STIFFNESS * e + DAMPING * e1

        zero, one = residual(0.0), residual(1.0)  # linear in the acceleration
        return zero / (zero - one)

    def change(time: float, state: np.ndarray) -> list[float]:
        e, e1 = state
        return [e1, acceleration(time, e, e1)]

    found = solve_ivp(change, (0.0, DURATION), np.zeros(2), "LSODA", TIMES, rtol=1e-8, atol=1e-12).y
    e, e1 = found
    return evaluated(e, e1, np.array([acceleration(*each) for each in zip(TIMES, e, e1, strict=True)]))


def largest(values: np.ndarray) -> float:
    return float(np.abs(values).max())


def test_the_section_torque_of_the_rigid_arm_is_that_of_the_source():
    """(3.41a): (J_z + m l^2 - m l^2 xi) times the angular acceleration."""
    phi2 = np.array([turned(*wanted(t), 0.0, 0.0, 0.0)[2] for t in TIMES])
    expected = (INERTIA + MASS * LENGTH**2 * (1.0 - SHARE)) * phi2
    np.testing.assert_allclose(rigid().section, expected, atol=1e-6)


def test_every_solution_has_the_point_on_its_path():
    for solution in (rigid(), approximate(), exact()):
        y = FAR * np.sin(solution.angle + solution.deflection) + NEAR * np.sin(solution.angle)
        np.testing.assert_allclose(y, PATH(TIMES), atol=1e-12)


def left(name: str) -> float:
    """The share of the rigid arm's largest error that the approximation leaves."""
    goal = getattr(exact(), name)
    return largest(getattr(approximate(), name) - goal) / largest(getattr(rigid(), name) - goal)


def test_the_approximation_is_far_nearer_to_the_exact_inverse_than_the_rigid_one():
    """Angles to a thousandth of what the rigid arm misses; as in the source, torques are not so near."""
    assert left("angle") < 1e-3
    assert left("deflection") < 1e-3
    assert 1e-3 < left("section") < 0.1
    assert 1e-3 < left("torque") < 0.1


def test_the_size_of_things():
    """The spring bends by milliradians; the driven joint turns back by the share of the lever behind it."""
    assert 1e-3 < largest(exact().deflection) < 1e-2
    ratio = largest(exact().angle - rigid().angle) / largest(exact().deflection)
    assert ratio == pytest.approx(FAR / LENGTH, rel=0.01)
    assert largest(exact().section) == pytest.approx(STIFFNESS * largest(exact().deflection), rel=1e-3)


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
    found = PLANT.torques(np.array([a, e]), np.array([a1, e1]), acceleration)
    np.testing.assert_allclose(found, expected, rtol=1e-12)

"""Two joints, the second one sprung: Reiner (2010), section 3.5.2, the smallest arm whose structure yields.

Three inverse models of it: one that takes it for rigid, the approximation by a parallel rigid model on which
`systems.feedforward.elastic_structure` is built, and the exact one, a differential equation. The point that
shall follow a path is the centre of mass, x_l = 0, where the exact inverse is stable.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
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

from robots.dynamics.elastic_structure import massless
from systems.feedforward.sprung_deflection import SprungDeflection

LENGTH, SHARE, MASS, INERTIA = 2.0, 0.2, 100.0, 10.0  # m, xi, kg, kg m^2
STIFFNESS, DAMPING = 1e6, 150.0  # N m / rad, N m s / rad
DURATION, PERIOD = 0.6, 1e-3  # s
ANGLE = 0.3  # rad, of the rigid arm at the end
NEAR, FAR = LENGTH * SHARE, LENGTH * (1.0 - SHARE)  # m, of the first and the second bar
TIMES = np.arange(0.0, DURATION + 0.5 * PERIOD, PERIOD)
# The point's y from 0 to l sin(0.3) with four continuous derivatives.
_RISE = Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])(Polynomial([0.0, 1.0 / DURATION]))
PATH = LENGTH * np.sin(ANGLE) * _RISE


class Solution(NamedTuple):
    """What figure 3.10 shows, over `TIMES`."""

    angle: np.ndarray  # rad, of the driven joint
    deflection: np.ndarray  # rad, of the sprung joint
    torque: np.ndarray  # N m, of the driven joint
    section: np.ndarray  # N m, in the sprung joint


class TwoJointArm:
    """The arm as a plant without spring and damper, and its three inverse models."""

    def __init__(self) -> None:
        """Builds the plant, lying, so that gravity has no part."""
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
        self._context, self._forces = self.plant.CreateDefaultContext(), MultibodyForces(self.plant)

    def torques(self, q: np.ndarray, v: np.ndarray, vdot: np.ndarray) -> np.ndarray:
        """(3.36) without the spring: what both joints need, in N m, shape (2,)."""
        self.plant.SetPositionsAndVelocities(self._context, np.concatenate([q, v]))
        self._forces.SetZero()
        return self.plant.CalcInverseDynamics(self._context, vdot, self._forces)

    def rigid(self) -> Solution:
        """The arm taken for rigid."""
        zero = np.zeros(len(TIMES))
        return self._evaluated(zero, zero, zero)

    def approximate(self) -> Solution:
        """The section torque of the rigid arm, (3.41), then the driven joint of the deformed one."""
        load = self.rigid().section
        spring = SprungDeflection(np.array([STIFFNESS]), np.array([DAMPING]), PERIOD)
        e = [spring.at_rest(load[:1])]
        for before, now in pairwise(load):
            e.append(spring.step(e[-1], np.array([before]), np.array([now])))
        deflection = np.array(e)[:, 0]
        rate = np.gradient(deflection, PERIOD, edge_order=2)
        return self._evaluated(deflection, rate, np.gradient(rate, PERIOD, edge_order=2))

    def exact(self) -> Solution:
        """The second row of (3.36) with the driven joint of (3.37): an equation of the deflection alone."""
        start = [0.0, 0.0]
        e, e1 = solve_ivp(self._change, (0.0, DURATION), start, "LSODA", TIMES, rtol=1e-8, atol=1e-12).y
        e2 = [self._change(time, np.array(state))[1] for time, *state in zip(TIMES, e, e1, strict=True)]
        return self._evaluated(e, e1, np.array(e2))

    def _change(self, time: float, state: np.ndarray) -> list[float]:
        e, e1 = state

        def residual(e2: float) -> float:
            phi, phi1, phi2 = driven_joint(time, e, e1, e2)
            row = self.torques(np.array([phi, e]), np.array([phi1, e1]), np.array([phi2, e2]))[1]
            return row + STIFFNESS * e + DAMPING * e1

        zero, one = residual(0.0), residual(1.0)  # linear in the acceleration
        return [e1, zero / (zero - one)]

    def _evaluated(self, e: np.ndarray, e1: np.ndarray, e2: np.ndarray) -> Solution:
        """The driven joint and all torques for a course of the deflection."""
        sprung = np.stack([e, e1, e2], axis=1)
        driven = np.array([driven_joint(time, *each) for time, each in zip(TIMES, sprung, strict=True)])
        both = np.stack([driven, sprung], axis=2)  # times, derivatives, joints
        torque, section = np.array([self.torques(*each) for each in both]).T
        return Solution(driven[:, 0], e, torque, section)


def driven_joint(time: float, e: float, e1: float, e2: float) -> np.ndarray:
    """Angle, speed and acceleration of the driven joint, eq. (3.37), (3,), for those of a deflection."""
    y, rate, acceleration = (float(PATH.deriv(order)(time)) for order in range(3))
    # y = A sin(phi) + B cos(phi) with A = near + far cos(e), B = far sin(e)
    A, B = NEAR + FAR * np.cos(e), FAR * np.sin(e)
    phi = np.arcsin(y / np.hypot(A, B)) - np.arctan2(B, A)
    s, c, se, ce = np.sin(phi), np.cos(phi), np.sin(phi + e), np.cos(phi + e)
    lever = NEAR * c + FAR * ce
    phi1 = (rate - FAR * ce * e1) / lever
    phi2 = (acceleration - FAR * ce * e2 + NEAR * s * phi1**2 + FAR * se * (phi1 + e1) ** 2) / lever
    return np.array([phi, phi1, phi2])

"""What a motion along a path asks of the drives, against Drake's inverse dynamics and its derivatives."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces_

from robots.description.model import load_robot
from robots.dynamics.plant import add_robot
from robots.planning.joint_path import PathError, smooth_curve, straight_joint_path
from robots.planning.limit_use import require_standing
from robots.planning.limits import motion_limits
from robots.planning.path_dynamics import PathDynamics
from robots.planning.time_spline import TimeSpline, at_rest

PAYLOAD = 16.0
START, GOAL = (
    np.deg2rad([10.0, -70.0, 60.0, 20.0, 40.0, -30.0]),
    np.deg2rad([-20.0, -40.0, 90.0, 50.0, 10.0, 60.0]),
)


@pytest.fixture(scope="module")
def robot():
    return load_robot("kr16")


@pytest.fixture(scope="module")
def path():
    return straight_joint_path(START, GOAL)


@pytest.fixture(scope="module")
def motion():
    coefficients = at_rest(16)
    coefficients[6:10] = [0.1, 0.4, 0.7, 0.9]
    return TimeSpline(coefficients, 0.6)


def joint_motion(path, motion, t):
    """q and three derivatives by time."""
    s = motion.rates(np.array([t]))[:4, 0]
    slope = path.at(s[:1], 1)[0]
    return path.at(s[:1])[0], slope * s[1], slope * s[2], slope * s[3]


def test_rigid_torques_are_those_of_inverse_dynamics_and_their_rate_its_derivative(robot, path, motion):
    plant = MultibodyPlant(0.0)
    add_robot(plant, robot, "rigid", PAYLOAD)
    plant.Finalize()
    exact: Any = plant.ToAutoDiffXd()  # its stub knows it as a system alone
    context, forces = exact.CreateDefaultContext(), MultibodyForces_[AutoDiffXd](exact)
    dynamics = PathDynamics(robot, PAYLOAD, path, "rigid")
    for t in (0.1, 0.25, 0.4):
        q, v, a, j = joint_motion(path, motion, t)
        along = [
            np.array([AutoDiffXd(x, [dx]) for x, dx in zip(*pair, strict=True)])
            for pair in ((q, v), (v, a), (a, j))
        ]
        exact.SetPositionsAndVelocities(context, np.concatenate(along[:2]))
        exact.CalcForceElementsContribution(context, forces)
        torque = exact.CalcInverseDynamics(context, along[2], forces)
        own = robot.reflected_inertia * along[2] + robot.joint_viscous_friction * along[1]
        found = dynamics.demand(motion.rates(np.array([t])))
        assert found.gear_torque[0] == pytest.approx([x.value() for x in torque - own], rel=1e-5, abs=0.02)
        assert found.gear_torque_rate[0] == pytest.approx(
            ExtractGradient(torque - own)[:, 0], rel=1e-5, abs=1.0
        )


@pytest.mark.parametrize("kind", ["flexible_joint", "elastic_structure"])
def test_motors_turn_ahead_of_the_links_by_what_gears_yield(robot, path, motion, kind):
    """J theta'' + friction + load is the torque of a motor, with theta'' by differences of its speed."""
    dynamics, h = PathDynamics(robot, PAYLOAD, path, kind), 1e-5
    t = np.array([0.2, 0.3, 0.45])
    before, now, after = (dynamics.demand(motion.rates(t + step)) for step in (-h, 0.0, h))
    acceleration = (after.speed - before.speed) / (2.0 * h)
    friction = robot.joint_viscous_friction * now.speed
    friction += robot.joint_coulomb_friction * np.tanh(now.speed / (15.0 * robot.coulomb_velocity))
    wanted = robot.reflected_inertia * acceleration + friction + now.gear_torque
    assert now.motor_torque == pytest.approx(wanted, rel=1e-5, abs=0.01)
    rigid = PathDynamics(robot, PAYLOAD, path, "rigid").demand(motion.rates(t))
    if kind == "flexible_joint":  # theta' = q' + tau'/c
        assert now.speed == pytest.approx(
            rigid.speed + now.gear_torque_rate / robot.joint_stiffness, rel=1e-6, abs=1e-7
        )


@pytest.mark.parametrize("order", [1, 2])
def test_at_a_place_its_series_has_the_derivatives_of_the_path(robot, path, motion, order):
    dynamics = PathDynamics(robot, PAYLOAD, path, "elastic_structure")
    rates = motion.rates(np.array([0.25]))
    step, z = ca.SX.sym("step"), dynamics.places(rates[0, 0])
    values = dynamics.near(ca.vertcat(step, rates[1:, 0]), z)
    for _ in range(order):
        values = ca.jacobian(values, step)
    found = np.array(ca.Function("found", [step], [values])(0.0)).ravel()
    h = 1e-3
    apart = np.repeat(rates, 5, axis=1)
    apart[0] += h * np.arange(-2, 3)
    weights = {1: [1.0, -8.0, 0.0, 8.0, -1.0], 2: [-1.0, 16.0, -30.0, 16.0, -1.0]}[order]
    expected = dynamics.rows(apart) @ weights / (12.0 * h**order)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5 * np.abs(expected).max())


def test_a_motion_is_at_rest_at_its_ends_with_five_derivatives(motion):
    h = 1e-4
    for end in (0.0, motion.duration):
        near = motion.rates(np.array([end, abs(end - h), abs(end - 2.0 * h)]))
        assert near[1:, 0] == pytest.approx(np.zeros(4), abs=1e-6)
        # The fourth derivative begins with the square of the time: the fifth is zero, too.
        assert near[4, 2] / near[4, 1] == pytest.approx(4.0, rel=0.02)


def test_a_path_with_a_corner_is_refused_with_its_place():
    def corner(s):
        return np.abs(s - 0.3)[:, None] * np.ones(6)

    with pytest.raises(PathError, match="the path of the joints is not smooth near 30 % of the path"):
        smooth_curve(corner, "the path of the joints")


def test_limits_that_cannot_hold_the_arm_are_refused_with_limit_and_place(robot):
    dynamics = PathDynamics(
        robot, PAYLOAD, straight_joint_path(np.deg2rad([0, -90.0, 90, 0, 0, 0]), np.zeros(6)), "rigid"
    )
    weak = motion_limits(robot).scaled(0.3)
    with pytest.raises(
        PathError, match=r"stand still at 100 % of the path takes 1\d\d % of the motor torque 2"
    ):
        require_standing(dynamics, weak)

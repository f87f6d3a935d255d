"""Compiled kinematics: the same numbers as the code written out for a robot, in a fraction of its time."""

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.kinematics.compiled import CompiledKinematics
from robots.kinematics.forward import Kinematics, robust_solve
from robots.kinematics.kernels import robust_solve as compiled_solve


@pytest.mark.parametrize("name", ["irb1200", "kr16", "ur10"])
def test_pose_and_jacobian_are_those_of_the_generated_code(name: str):
    robot = load_robot(name)
    compiled, generated = CompiledKinematics(robot), Kinematics(robot)
    for q in np.random.default_rng(0).uniform(robot.lower, robot.upper, (100, 6)):
        rows, J = compiled.rows_and_jacobian(q)
        X_WE, expected = generated.forward_and_jacobian(q)
        np.testing.assert_allclose(rows, X_WE[:3], atol=1e-14)
        np.testing.assert_allclose(J, expected, atol=1e-14)


@pytest.mark.parametrize("beside", [0.0, 1e-9, 1e-6, 1e-5, 1e-3, 1.0])
def test_rates_near_a_singular_wrist_are_those_of_the_damped_inverse(beside: float):
    """Inverses of small singular values multiply rounding; damped at 1e-4, by 1e4 at most."""
    rng, kinematics = np.random.default_rng(1), Kinematics(load_robot("irb1200"))
    for _ in range(20):
        q, V = rng.uniform(-1.0, 1.0, 6), rng.normal(size=(6, 2))
        q[4] = beside
        J = np.ascontiguousarray(kinematics.jacobian(q))
        expected = robust_solve(J, V)
        np.testing.assert_allclose(compiled_solve(J, V), expected, atol=1e-10 * np.abs(expected).max())

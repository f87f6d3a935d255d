"""The recursion of Newton and Euler against Drake's."""

import casadi as ca
import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

from robots.description.model import NUM_JOINTS, load_robot
from robots.dynamics.plant import add_robot
from robots.planning.arm_expression import ArmExpression


@pytest.mark.parametrize("name", ["kr16", "kr210", "irb1200", "puma560"])
def test_it_is_the_arm_of_the_plant(name: str):
    robot = load_robot(name)
    payload = 0.7 * robot.payload.largest_mass
    symbols = [ca.SX.sym(each, NUM_JOINTS) for each in "qva"]
    function = ca.Function("load", symbols, [ArmExpression(robot, payload).load(*symbols)])
    plant = MultibodyPlant(0.0)
    parts = add_robot(plant, robot, "rigid", payload)
    plant.Finalize()
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    motors = [joint.position_start() for joint in parts.motors]
    rng = np.random.default_rng(1)
    for _ in range(10):
        q, v, a = rng.uniform(robot.lower, robot.upper), *rng.uniform(-3.0, 3.0, (2, NUM_JOINTS))
        plant.SetPositionsAndVelocities(context, np.concatenate([q, v]))
        plant.CalcForceElementsContribution(context, forces)
        torque = plant.CalcInverseDynamics(context, a, forces)[motors]
        wanted = torque - robot.reflected_inertia * a - robot.joint_viscous_friction * v
        assert np.array(function(q, v, a)).ravel() == pytest.approx(wanted, rel=1e-9, abs=1e-9)

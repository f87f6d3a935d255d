"""The torque of gears that stiffen under load, beside the linear springs that a plant has for them."""

import numpy as np
from pydrake.symbolic import Expression, MakeVectorContinuousVariable
from pydrake.systems.primitives import SymbolicVectorSystem

from robots.dynamics.plant import PlantRobot


def stiffening_gears(robot: PlantRobot) -> SymbolicVectorSystem:
    """A system from the state of a robot's plant to generalized forces, which the plant takes as applied.

    A system of Drake's own: the integrator asks for these torques at every stage of every step, thousands of
    times a second, which Python would make slow.

    Args:
        robot: of a finalized plant, with gears that stiffen.
    """
    plant = robot.plant
    state = MakeVectorContinuousVariable(plant.num_multibody_states(), "x")
    gears = [joint.position_start() for joint in robot.deflections]
    forces = np.array([Expression(0.0)] * plant.num_velocities(), dtype=object)
    # Arithmetic with formulas sets the processor's flag for numbers that are none, of which numpy would warn.
    with np.errstate(invalid="ignore"):
        deflection = np.array([Expression(state[row]) for row in gears], dtype=object)
        excess = robot.stiffening_torque(deflection)
        forces[[joint.velocity_start() for joint in robot.deflections]] = -excess
    # Without a state of its own such a system refuses to be integrated along with others: one that rests.
    idle = MakeVectorContinuousVariable(1, "idle")
    at_rest = np.array([Expression(0.0)], dtype=object)
    return SymbolicVectorSystem(input=state, state=idle, dynamics=at_rest, output=forces)

"""The arm behind the gears: its section torques, its load and its tip, against the equations of motion."""

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant

from robots.description.model import load_robot
from robots.dynamics.plant import add_robot
from systems.feedforward import JointReference
from systems.feedforward.deformed_arm import DeformedArm

ROBOTS = {"irb1200": 7.0, "kr16": 16.0, "kr210": 210.0}
RNG = np.random.default_rng(5)
REFERENCE = JointReference(*(RNG.uniform(-1.0, 1.0, 6) for _ in range(3)))


class EquationsOfMotion:
    """M vdot + C v - gravity and counterbalance, from the mass matrix and not by recursion."""

    def __init__(self, name: str) -> None:
        plant = self.plant = MultibodyPlant(0.0)
        self.parts = add_robot(plant, load_robot(name), "structure", ROBOTS[name])
        plant.Finalize()
        self.context = plant.CreateDefaultContext()
        self.joints, self.gears, self.structure = (
            [joint.velocity_start() for joint in group]
            for group in (self.parts.motors, self.parts.deflections, self.parts.structure)
        )

    def torques(self, reference: JointReference, *structure: np.ndarray) -> np.ndarray:
        q, v, vdot = np.zeros((3, self.plant.num_velocities()))
        motion = (reference.position, reference.velocity, reference.acceleration)
        for place, of_joints, of_structure in zip((q, v, vdot), motion, structure, strict=True):
            place[self.joints], place[self.structure] = of_joints, of_structure
        self.plant.SetPositionsAndVelocities(self.context, np.concatenate([q, v]))
        M, bias = self.plant.CalcMassMatrix(self.context), self.plant.CalcBiasTerm(self.context)
        return M @ vdot + bias - self.parts.load(self.context)


@pytest.mark.parametrize("name", ROBOTS)
def test_section_torques_are_the_coupling_rows_of_the_rigid_motion(name: str):
    """(3.76): springs and dampers add nothing where nothing is deformed."""
    motion, arm = EquationsOfMotion(name), DeformedArm(load_robot(name), ROBOTS[name])
    still = np.zeros(arm.size)
    expected = motion.torques(REFERENCE, still, still, still)[motion.structure]
    np.testing.assert_allclose(arm.section_torques(REFERENCE), expected, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_gears_carry_what_the_deformed_arm_asks_for(name: str):
    """(3.91), corrected: with the second derivative of the deflections."""
    motion, arm = EquationsOfMotion(name), DeformedArm(load_robot(name), ROBOTS[name])
    e, e1, e2 = (scale * RNG.standard_normal(arm.size) for scale in (1e-3, 0.1, 5.0))
    expected = motion.torques(REFERENCE, e, e1, e2)[motion.gears]
    np.testing.assert_allclose(arm.gear_load(REFERENCE, (e, e1, e2)), expected, rtol=1e-9, atol=1e-6)


def test_the_jacobian_is_the_derivative_of_the_pose():
    arm, q, step = DeformedArm(load_robot("kr16"), 16.0), REFERENCE.position, 1e-6
    e = 1e-3 * RNG.standard_normal(arm.size)
    J = arm.pose_and_jacobian(q, e)[1]
    for joint in range(6):
        moved = [arm.pose(q + sign * step * np.eye(6)[joint], e) for sign in (1.0, -1.0)]
        rate = (moved[0] - moved[1]) / (2.0 * step)
        spin = rate[:, :3] @ arm.pose(q, e)[:, :3].T
        found = np.concatenate([[spin[2, 1], spin[0, 2], spin[1, 0]], rate[:, 3]])
        np.testing.assert_allclose(J[:, joint], found, atol=1e-8)


def test_a_robot_of_which_only_gears_yield_is_refused():
    robot = load_robot("irb1200")
    for joint in robot.joints:
        joint.tilting = None
    with pytest.raises(ValueError, match=r"no bearing or beam of ABB IRB 1200-7/0\.7 yields"):
        DeformedArm(robot)

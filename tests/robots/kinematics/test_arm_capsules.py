"""The arm as capsules: where Drake's plant has its links."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from robots.description.model import NUM_JOINTS, load_robot
from robots.dynamics.plant import add_robot
from robots.kinematics.arm_capsules import ArmCapsules

ROBOT = load_robot("irb1200")


def test_capsules_run_from_joint_to_joint_of_the_plant():
    plant = MultibodyPlant(0.0)
    add_robot(plant, ROBOT, "rigid")
    plant.Finalize()
    context = plant.CreateDefaultContext()
    arm, rng = ArmCapsules(ROBOT), np.random.default_rng(0)
    names = ["base", *(f"link_{i}" for i in range(1, NUM_JOINTS + 1))]
    for q in rng.uniform(ROBOT.lower, ROBOT.upper, (20, NUM_JOINTS)):
        plant.SetPositions(context, q)
        origins = np.array(
            [plant.GetBodyByName(name).EvalPoseInWorld(context).translation() for name in names]
        )
        capsules = arm.at(q)
        np.testing.assert_allclose(capsules.start, origins[:-1], atol=1e-12)
        np.testing.assert_allclose(capsules.end, origins[1:], atol=1e-12)
    np.testing.assert_array_equal(capsules.radius, [0.1, *(link.radius for link in ROBOT.links[:-1])])

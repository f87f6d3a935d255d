"""What the last body of a robot weighs with another load at the flange."""

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia

from robots.description.model import RobotModel
from robots.dynamics.plant import add_robot


def carried_inertia(robot: RobotModel, elasticity: str, payload: float) -> SpatialInertia:
    """The spatial inertia of the body that carries the tool, in its own frame, with a load.

    Args:
        robot: with the centre of its payload.
        elasticity: of the plant that the body belongs to, as `robots.dynamics.plant.add_robot` takes it.
        payload: mass at the flange in kg.

    Raises:
        ValueError: if the robot may not carry that much.
    """
    plant = MultibodyPlant(0.0)
    body = add_robot(plant, robot, elasticity, payload).tool.body()
    plant.Finalize()
    return body.default_spatial_inertia()

"""Benchmark of the inverse models: cost of a tick and tracking error.

The yardstick of the time is Drake's inverse dynamics of the elastic plant of the same robot, called once.
"""

from collections.abc import Iterator

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

from experiments.feedforward.rectangle import RectangleTrial
from experiments.feedforward.tick import median_time, tick_time
from robots.description.model import RobotModel, load_robot
from robots.dynamics.plant import add_robot
from systems.feedforward import FEEDFORWARDS, FeedforwardConfig

ROBOT = "kr16"
ALLOWED_TICK = 400.0  # us
CALLS = 2000
# Of the rigid model's deviation; the last ones with all elastic parameters of the model a fifth off.
REQUIRED_DEVIATION = {"flexible_joint": 0.6, "elastic_structure": 0.2}
STIFFNESS_ERRORS, REQUIRED_WITH_ERROR = (0.2, -0.2), 0.45

Row = tuple[str, str, float, str, float, str]  # name, what it is, value, unit, yardstick, what that is


def feedforward() -> Iterator[Row]:
    """Benchmarks of the inverse models."""
    robot = load_robot(ROBOT)
    payload = robot.payload.largest_mass
    for kind in FEEDFORWARDS:
        tick = 1e6 * tick_time(RectangleTrial(robot, payload, FeedforwardConfig(kind)))
        text = f"feedforward {kind}, a tick"
        yield f"feedforward_tick_{kind}", text, tick, "us", ALLOWED_TICK, "allowed"
        drake = 1e6 * inverse_dynamics_time(robot, payload)
        yield f"feedforward_drake_{kind}", text, tick, "us", drake, "inverse dynamics"
    rigid = RectangleTrial(robot, payload, FeedforwardConfig("rigid")).run()
    for kind, required in REQUIRED_DEVIATION.items():
        path = RectangleTrial(robot, payload, FeedforwardConfig(kind)).run()
        text, worst = (
            f"feedforward {kind}, deviation",
            max(path.integral / rigid.integral, path.max / rigid.max),
        )
        yield f"feedforward_path_{kind}", text, worst, "", required, "required"
    for error in STIFFNESS_ERRORS:
        wrong = RectangleTrial(robot, payload, FeedforwardConfig("elastic_structure", error)).run()
        side = "stiff" if error > 0.0 else "soft"
        text, worst = (
            f"the same, model {abs(error):.0%} too {side}",
            max(wrong.integral / rigid.integral, wrong.max / rigid.max),
        )
        yield f"feedforward_path_{side}", text, worst, "", REQUIRED_WITH_ERROR, "required"


def inverse_dynamics_time(robot: RobotModel, payload: float) -> float:
    """The median time in s of one inverse dynamics of the elastic plant, with gravity and springs."""
    plant = MultibodyPlant(0.0)
    add_robot(plant, robot, "structure", payload)
    plant.Finalize()
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    state, vdot = np.full(2 * plant.num_velocities(), 0.1), np.full(plant.num_velocities(), 0.2)

    def calculate() -> None:
        plant.SetPositionsAndVelocities(context, state)
        plant.CalcForceElementsContribution(context, forces)
        plant.CalcInverseDynamics(context, vdot, forces)

    return median_time(calculate, CALLS)


if __name__ == "__main__":
    for _, text, value, unit, yardstick, against in feedforward():
        print(f"{text:<40} {value:8.3g} {unit:<3} {against} {yardstick:.3g}")

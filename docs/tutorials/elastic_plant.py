"""Only the elastic robot, in a diagram of one's own: its load swings behind the brakes."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput

from robots.description.model import load_robot
from robots.dynamics.plant import add_robot

builder = DiagramBuilder()
plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))  # continuous: springs are exact
robot = add_robot(plant, load_robot("irb1200"), elasticity="joints", payload=5.0)
plant.Finalize()
motors = builder.AddSystem(ConstantVectorSource(np.zeros(plant.num_actuators())))
builder.Connect(motors.get_output_port(), plant.get_actuation_input_port())
log = LogVectorOutput(plant.get_state_output_port(), builder, 0.002)
simulator = Simulator(builder.Build())
context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
for i in range(1, 7):  # brakes hold the motors: what moves is the robot behind its gears
    plant.GetJointByName(f"motor_{i}").Lock(context)
simulator.AdvanceTo(0.3)
state = log.FindLog(simulator.get_context()).data()
deflection = [plant.GetJointByName(f"deflection_{i}").position_start() for i in range(1, 7)]
largest = np.rad2deg(np.abs(state[deflection]).max(axis=1))
print("largest deflection of the gears in degrees:", np.round(largest, 4))

"""An arm of one's own from a URDF: where it reaches, what is assumed in it, and its robot file."""

from pathlib import Path

import numpy as np

from robots.description.model import load_robot
from robots.description.robot_file import robot_text
from robots.kinematics.forward import Kinematics

robot = load_robot(str(Path(__file__).with_name("arm.urdf")))
X_WE = Kinematics(robot).forward(np.zeros(6))
print(f"{robot.name}: the tool at {np.round(X_WE[:3, 3], 3)} m with all joints at zero")
text = robot_text(robot)  # to put in what a URDF does not hold: gears, springs, friction
print(f"{text.count('assumed')} parts of its robot file are assumed")
stiffness = [joint.drive_train.stiffness for joint in robot.joints]
print("stiffness of the gears in N m / rad:", np.round(stiffness))

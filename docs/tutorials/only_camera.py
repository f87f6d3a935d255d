"""Only the camera system: ten cameras look at the markers of a tool that stands still."""

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import AddRandomInputs, ConstantValueSource

from systems.cell.marker_camera import MarkerCamera, MarkerFeaturesConfig
from systems.cell.pose_camera import BLOCK

config = MarkerFeaturesConfig(period=0.01, delay=0.0)  # 100 poses a second, 0.1 px of noise
X_WE = RigidTransform(RollPitchYaw(0.0, np.pi / 2, 0.0), [0.45, 0.0, 0.4])
builder = DiagramBuilder()
camera = builder.AddSystem(MarkerCamera(config))
tool = builder.AddSystem(ConstantValueSource(Value(X_WE)))
builder.Connect(tool.get_output_port(), camera.GetInputPort("X_WE"))
AddRandomInputs(BLOCK * config.period, builder)
diagram = builder.Build()
simulator = Simulator(diagram)
diagram.SetRandomContext(simulator.get_mutable_context(), RandomGenerator(1))
context = camera.GetMyContextFromRoot(simulator.get_context())
found = []
for tick in range(1, 101):
    simulator.AdvanceTo(tick * config.period)
    sample = camera.GetOutputPort("pose_sample").Eval(context)
    if sample.valid:
        found.append(sample.X_WE.translation())
spread = 1e6 * np.std(found, axis=0)
print(f"{len(found)} poses, standard deviation along x, y, z in micrometres: {np.round(spread, 1)}")

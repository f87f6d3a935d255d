"""Run time of one tick of an inverse model within a diagram."""

import time
from collections.abc import Callable
from statistics import median

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource

from diagrams.scenario.controller_model import controller_model
from experiments.feedforward.rectangle import SETTLE, RectangleTrial, rectangle_scenario
from systems.feedforward import FEEDFORWARDS
from systems.reference.reference import Reference
from systems.samples import JointSample

TICKS = 1000  # that are timed, along the rectangle


def tick_time(trial: RectangleTrial) -> float:
    """The median time in s of a tick along a rectangle, reference and inverse kinematics included."""
    scenario = rectangle_scenario(trial)
    period = scenario.station.period
    builder = DiagramBuilder()
    reference = builder.AddSystem(Reference(scenario.reference, period))
    model = FEEDFORWARDS[trial.config.kind](controller_model(scenario, trial.robot), trial.config)
    model.prepare(reference.path, np.deg2rad(scenario.home_deg))
    builder.AddSystem(model)
    start = JointSample(position=np.deg2rad(scenario.home_deg), running=True)
    joints = builder.AddSystem(ConstantValueSource(Value(start)))
    for name in ("X_WE", "V_WE", "A_WE"):
        port = model.GetInputPort(f"{name}_desired")
        builder.Connect(reference.GetOutputPort(f"{name}_preview"), port)
    builder.Connect(joints.get_output_port(), model.GetInputPort("joint_sample"))
    simulator = Simulator(builder.Build())
    simulator.Initialize()
    simulator.AdvanceTo(SETTLE)
    ends = iter((SETTLE + period * np.arange(1, TICKS + 1)).tolist())
    return median_time(lambda: simulator.AdvanceTo(next(ends)), TICKS)


def median_time(work: Callable[[], object], repeats: int) -> float:
    """The median time in s that something takes."""
    seconds = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - started)
    return median(seconds)

"""The baseline for the cost of the closed loop: plant and drives alone, making the same motion."""

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Demultiplexer, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from diagrams.driven_robot import add_driven_robot
from diagrams.record.log import RunLog
from diagrams.runs.simulation import Experiment
from diagrams.true_robot import true_robot
from robots.description.model import NUM_JOINTS, RobotModel


class BarePlant:
    """Plant and drives of an experiment, fed with the commands that it has recorded.

    No camera, no law, no guard, no logs. Integration scheme, accuracy and largest step are those of the
    experiment.
    """

    def __init__(self, experiment: Experiment, robot: RobotModel, log: RunLog) -> None:
        """Builds the diagram and puts it at rest where the experiment began.

        Args:
            experiment: what to take plant, drives and integrator from.
            robot: its nominal robot.
            log: what it has recorded, from the start on.
        """
        config = experiment.scenario.station
        builder = DiagramBuilder()
        kind = experiment.scenario.servo.laws[experiment.law].drive
        self._driven = add_driven_robot(builder, robot, true_robot(robot, config), config, kind)
        drive = self._driven.drive
        commands = builder.AddNamedSystem("commands", TrajectorySource(_held(log, config.period)))
        split = builder.AddNamedSystem("split", Demultiplexer([NUM_JOINTS, NUM_JOINTS]))
        builder.Connect(commands.get_output_port(), split.get_input_port())
        builder.Connect(split.get_output_port(0), drive.GetInputPort("position_command"))
        builder.Connect(split.get_output_port(1), drive.GetInputPort("velocity_command"))
        self._diagram: Diagram = builder.Build()
        self._simulator = Simulator(self._diagram)
        self._context = self._simulator.get_mutable_context()
        # The motors begin where they were measured first; they are at rest there.
        theta = log.joint_position[np.isfinite(log.joint_position).all(axis=1)][0]
        self._driven.set_at_rest(self._context, theta)
        self._integration = experiment.integration
        self._integration.initialize(self._simulator)

    def advance(self, until: float) -> None:
        """Advances to a time in s."""
        self._integration.advance(self._simulator, until)

    def link_positions(self) -> np.ndarray:
        """Link positions now, in rad, shape (6,)."""
        plant = self._driven.plant
        return self._driven.links.link_positions(
            plant.GetPositions(plant.GetMyContextFromRoot(self._context))
        )


def _held(log: RunLog, period: float) -> PiecewisePolynomial:
    """The recorded commands, each held from half a period before its tick to half a period after it."""
    commands = np.hstack([log.position_command, log.velocity_command])
    breaks = np.append(log.time, log.time[-1] + period) - 0.5 * period
    return PiecewisePolynomial.ZeroOrderHold(breaks, np.vstack([commands, commands[-1]]).T)

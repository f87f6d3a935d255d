"""What tests of diagrams share: short scenarios, and a servo whose station is played by hand."""

from collections.abc import Callable

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from diagrams.runs.simulation import Experiment
from diagrams.runs.start import start_position
from diagrams.scenario.scenario import Scenario, load_scenario
from diagrams.servo import Servo
from robots.description.model import load_robot
from robots.pose import pose_error
from systems.guard.guard import KINDS
from systems.samples import JointSample, PoseSample
from tests.systems.rigs import PERIOD, ValueSignal

LAWS = ("numerical_ik", "pbvs", "position_level")
QUIET = ["station.camera.position_sigma=0", "station.camera.orientation_sigma_deg=0"]
SETTLE = ["reference.settle=20"]  # the path begins after the end of the test


def scenario(name: str, *settings: str) -> Scenario:
    return load_scenario(name, list(settings))


def true_errors(experiment: Experiment) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) and true errors (n, 6) in rad and m of what has happened so far."""
    log = experiment.log()
    return log.time, pose_error(log.X_WE_desired, log.X_WE_true)


class PlayedStation:
    """A servo against samples that are functions of time, without any robot.

    The joints report the start position for ever. ``pose_sample`` maps a time in s to a `PoseSample`.
    """

    def __init__(self, scenario: Scenario, law: str, pose_sample: Callable[[float], PoseSample]) -> None:
        robot = load_robot(scenario.robot)
        builder = DiagramBuilder()
        self.servo = builder.AddSystem(Servo(robot, scenario, law))
        self.start = start_position(self.servo.model, scenario, self.servo.reference.path)
        still = np.zeros(6)
        signals = {
            "joint_sample": lambda time: JointSample(time, self.start, still, still, True),
            "pose_sample": pose_sample,
        }
        for name, signal in signals.items():
            source = builder.AddSystem(ValueSignal(signal))
            builder.Connect(source.get_output_port(), self.servo.GetInputPort(name))
        self.simulator = Simulator(builder.Build())
        self.context = self.servo.GetMyContextFromRoot(self.simulator.get_context())

    def output(self, name: str) -> np.ndarray:
        return self.servo.GetOutputPort(name).Eval(self.context).copy()

    def run(self, duration: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, np.ndarray]]:
        """Times, position and velocity commands and the counts by kind at every tick."""
        times = np.arange(round(duration / PERIOD) + 1) * PERIOD
        rows = []
        for time in times:
            self.simulator.AdvanceTo(time)
            rows.append([self.output(n) for n in ("position_command", "velocity_command", "guard_status")])
        positions, velocities, counts = (np.array(part) for part in zip(*rows, strict=True))
        return times, positions, velocities, dict(zip(KINDS, counts.T, strict=True))

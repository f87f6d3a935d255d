"""Runs the law on a MuJoCo cell and says how far its tip was from the path."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from diagrams.runs.start import start_position
from diagrams.servo import Servo, learnt
from experiments.bench.mujoco_cell.arm import Wrong, drawn_arm, true_arm
from experiments.bench.mujoco_cell.cell import Camera, Drives, MujocoCell
from experiments.bench.mujoco_cell.gears import Wear, WornGears
from experiments.cli.workers import Progress
from experiments.robustness.cases import Case
from experiments.robustness.contenders import Contender
from experiments.robustness.study import Trial
from robots.description.model import load_robot
from robots.pose import rotation_vector

LAW = "self_calibrating"
_GEARS_ERR = "servo.laws.self_calibrating.estimator.spread.gear_error"  # rad
_SETTLED = 0.5  # s of the dwell, after which the tip is at rest
_LONGEST = 5.0  # times the planned duration, after which a run is over


@dataclass(frozen=True)
class CellRun:
    """A robot with everything wrong, and the path that it runs."""

    robot: str
    seed: int
    path: str = "rectangle"
    laps: int = 2
    wrong: Wrong = field(default_factory=Wrong)
    drives: Drives = field(default_factory=Drives)
    camera: Camera = field(default_factory=Camera)
    wear: Wear | None = None  # of the gears, which are springs and dampers else
    more: tuple[str, ...] = ()  # settings of the scenario

    @property
    def settings(self) -> tuple[str, ...]:
        """Of the scenario: what is believed of the interface is right, and that gears err is known."""
        interface = ("station.interface=egm",) if self.drives.planner else ()
        gears = () if self.wear is None else (f"{_GEARS_ERR}=5e-5",)
        return *interface, *gears, *self.more


def run(job: CellRun, progress: Progress) -> dict[str, Any]:
    """Runs all laps, from rest, with the drawing of the robot as the controller's belief.

    Of the scenario `everything`, carried over to the robot, are the path, the load and what the controller
    believes.

    Returns:
        ``robot``, ``seed`` and ``path``; ``laps``, each ``max_norm_mm`` and ``max_angle_deg`` of the true
        tip and ``times_planned``, how many times the planned time it took; ``static_mm``; ``guard``, how
        often it intervened; and what was ``learnt``.
    """
    plain, law = Case("plain", job.settings), Contender(LAW, LAW)
    scenario = Trial("everything", plain, law, job.seed, job.path, job.laps, job.robot).load()
    robot, station = load_robot(scenario.robot), scenario.station
    servo = Servo(robot, scenario, LAW)
    theta = start_position(servo.model, scenario, servo.reference.path)
    true = true_arm(robot, station.payload, job.wrong, job.seed)
    drawn = drawn_arm(robot, station.payload)
    builder = DiagramBuilder()
    builder.AddNamedSystem("servo", servo)
    gears = None if job.wear is None else WornGears(true, robot, job.wear, job.seed)
    parts = job.drives, job.camera, station.period, theta, job.seed
    cell = builder.AddNamedSystem("cell", MujocoCell(true, drawn, *parts, gears))
    for name in ("position_command", "velocity_command", "torque_feedforward")[: cell.taken]:
        builder.Connect(servo.GetOutputPort(name), cell.GetInputPort(name))
    for name in ("joint_sample", "pose_sample"):
        builder.Connect(cell.GetOutputPort(name), servo.GetInputPort(name))
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    simulator.Initialize()
    path = servo.reference.path
    rows: list[tuple[float, float, float]] = []
    while servo.path_time(context) < path.duration and context.get_time() < _LONGEST * path.duration:
        simulator.AdvanceTo((len(rows) + 1) * station.period)
        time = servo.path_time(context)
        X_WE = cell.GetOutputPort("truth.X_WE").Eval(cell.GetMyContextFromRoot(context)).reshape(4, 4)
        wanted = path.sample(time)[0]
        turn = rotation_vector(X_WE[:3, :3] @ wanted[:3, :3].T)
        rows.append((time, float(np.linalg.norm(X_WE[:3, 3] - wanted[:3, 3])), float(np.linalg.norm(turn))))
        progress(min(1.0, time / path.duration))
    table = np.array(rows)
    ends = [*path.lap_starts[1:], path.dwell_start]
    laps = []
    for start, end in zip(path.lap_starts, ends, strict=True):
        lap = table[(table[:, 0] >= start) & (table[:, 0] < end), 1:]
        distance, angle = lap.max(axis=0)
        took = len(lap) * station.period / (end - start)
        laps.append(
            {
                "max_norm_mm": 1e3 * distance,
                "max_angle_deg": float(np.rad2deg(angle)),
                "times_planned": took,
            }
        )
    status = servo.GetOutputPort("guard_status").Eval(servo.GetMyContextFromRoot(context))
    return {
        "robot": job.robot,
        "seed": job.seed,
        "path": job.path,
        "laps": laps,
        "static_mm": 1e3 * float(table[table[:, 0] > path.dwell_start + _SETTLED, 1].max()),
        "guard": int(np.sum(status)),
        "learnt": learnt(servo, context) or {},
    }

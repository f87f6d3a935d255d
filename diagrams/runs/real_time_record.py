"""What a run on a real station leaves behind."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from diagrams.host_lateness import HostLateness
from diagrams.live_watch import LivePeople
from diagrams.record.log import GuardEvent, RunLog
from diagrams.record.run_record import RunRecord, write_tick
from diagrams.record.topics import POSE, pose_message
from diagrams.servo import Servo
from systems.link.clock import ClockQuality
from systems.link.protocols import RobotReport
from systems.samples import PoseSample


@dataclass
class RealTimeRecord:
    """What a run on a real station leaves behind beside its log."""

    log: RunLog
    stamps: np.ndarray  # (n,) s, the controller's clock at each tick of the log; NaN where no message came
    ended: str  # why: "path", or what broke off
    counters: dict[str, int]
    camera: dict[str, Any]
    turn_around: np.ndarray  # (m,) s, from a message in to its reply out
    camera_clock: ClockQuality | None
    robot_clock: ClockQuality
    host: HostLateness
    pauses: list[tuple[float, float]] = field(default_factory=list)  # s: path time, how long it stood still
    events: list[GuardEvent] = field(default_factory=list)  # of the wire, by path time
    limited_messages: int = 0  # that were not sent as the servo wanted them
    people: LivePeople | None = None  # where somebody looked for them


def write_run_tick(
    stream: RunRecord,
    servo: Servo,
    root_context: Context,
    time: float,
    report: RobotReport,
    effort: np.ndarray,
    command: tuple[np.ndarray, np.ndarray],
    new: PoseSample,
) -> None:
    """Logs a tick, after its reply is on its way.

    Args:
        stream: where to.
        servo: which has been updated in the context.
        root_context: of its diagram.
        time: s of the path's clock.
        report: that was answered.
        effort: in it, (6,) in N m.
        command: what was sent: positions in rad and speeds in rad/s, (6,) each.
        new: what the camera has seen since the last tick; not valid for nothing.
    """
    context = servo.GetMyContextFromRoot(root_context)
    correction = servo.GetOutputPort("correction").Eval(context)
    X_WE_desired = servo.GetOutputPort("X_WE_desired").Eval(context).GetAsMatrix4()
    path_time = servo.path_time(root_context) if servo.reference.is_slowed else None
    joints = report.position, effort
    write_tick(stream, time, report.time, joints, command, correction, X_WE_desired, path_time)
    if new.valid:
        stream.write(POSE, time, pose_message(new.X_WE.GetAsMatrix4(), new.time))


def fill_gaps(rows: np.ndarray) -> None:
    """Where no message came, the last one stands; in place."""
    for index in range(1, len(rows)):
        if math.isnan(rows[index, 0]):
            rows[index] = rows[index - 1]

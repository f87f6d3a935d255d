"""The log of one run: arrays at the sampling rate, guard events and the time marks of the path."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from robots.description.model import RobotModel


@dataclass(frozen=True)
class GuardEvent:
    """One intervention of the guard."""

    time: float  # s
    kind: str  # for example "velocity_limit"; see systems.guard.guard.KINDS
    detail: str  # what was limited, in words
    lasted: float = 0.0  # s, of an unbroken row of ticks

    @property
    def end(self) -> float:
        """When it was over, in s."""
        return self.time + self.lasted


@dataclass(frozen=True)
class RunLog:
    """The record of one law on one station, n samples at the camera's exposure times.

    Poses are homogeneous matrices. Errors count from ``path_start``; the path is at rest from
    ``dwell_start`` to ``path_end``.
    """

    law: str
    seed: int
    time: np.ndarray  # (n,) s
    X_WE_desired: np.ndarray  # (n, 4, 4)
    X_WE_true: np.ndarray  # (n, 4, 4), what a perfect instrument would see
    X_WE_measured: np.ndarray  # (n, 4, 4), the sample exposed at this time; NaN where there was none
    joint_position: np.ndarray  # (n, 6) rad, measured by the station
    joint_effort: np.ndarray  # (n, 6) N m, joint side
    link_position: np.ndarray  # (n, 6) rad, true positions of the links behind the elastic gears
    position_command: np.ndarray  # (n, 6) rad
    velocity_command: np.ndarray  # (n, 6) rad/s
    correction: np.ndarray  # (n, 6) rad and m, what the law has added to the path so far
    guard_counts: dict[str, int]  # how often each kind of intervention happened
    guard_events: list[GuardEvent]  # the first ones in full
    path_start: float  # s
    dwell_start: float  # s
    path_end: float  # s
    lap_starts: tuple[float, ...] = ()  # s, of the laps if the path is run several times, else empty
    path_time: np.ndarray | None = (
        None  # (n,) s on the path where it was slowed, else None: then it is ``time``
    )
    learnt: dict[str, Any] | None = None  # what the law says that it has learnt; None of others
    # the robot as a law knows it that calibrates robots
    calibrated: RobotModel | None = field(default=None, compare=False)
    # s, wall time of each update of the law
    tick_seconds: np.ndarray = field(default_factory=lambda: np.empty(0), compare=False)
    wall_time: float = field(default=0.0, compare=False)  # s, of the simulation alone
    # of a log from a record: why the run ended before its path did, in words; else empty
    ended_early: str = field(default="", compare=False)

"""Moves one joint of a station back and forth and records the times of all messages and frames."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from diagrams.hardware_link import EndedOnRequest, HardwareLink, StationError, never
from diagrams.runs.undisturbed import undisturbed
from diagrams.scenario.scenario import Scenario
from robots.description.model import NUM_JOINTS, RobotModel
from systems.link.clock import ClockQuality, steady_time
from systems.link.protocols import PoseSource, RobotLink

_FREQUENCIES = (0.15, 0.25, 0.4)  # Hz: so slow that no filter or controller of the drives adds a millisecond
_RISE = 1.0  # s, in which the motion begins and ends
_LOOK = 50  # messages, after which the clocks are looked at
_PATIENCE = 3.0  # times the duration, in which the clocks may be set anew
_FOLLOWS = 0.05  # of the motion: a joint that moves by less is not moved by its commands


@dataclass
class LatencyConfig:
    """The test motion of a latency measurement."""

    joint: int = 1
    amplitude_deg: float = 4.0
    duration: float = 20.0  # s

    def check(self) -> None:
        """Refuses a motion that would show nothing. Raises ValueError, one line."""
        if not 1 <= self.joint <= NUM_JOINTS:
            raise ValueError(f"latency: joint must be 1 to {NUM_JOINTS}, got {self.joint}")
        if not (self.duration >= 4.0 and 0.0 < self.amplitude_deg <= 20.0):
            raise ValueError(
                "latency: duration must be at least 4 s and amplitude_deg in (0, 20], got "
                f"{self.duration} s and {self.amplitude_deg} deg"
            )


@dataclass(frozen=True)
class LatencyRecord:
    """Recorded messages and frames. Times are on this process's monotonic clock unless stated otherwise."""

    stamp: np.ndarray  # (n,) s, the controller's clock of every message
    commanded: np.ndarray  # (n,) rad, the joint as it was commanded in reply
    measured: np.ndarray  # (n,) rad, the joint as the message has it
    reported: np.ndarray  # (n,) when the message came, without its jitter
    seen: np.ndarray  # (m,) when a frame of the camera came, without its jitter
    position: np.ndarray  # (m, 3) m, of the tool
    turn_around: np.ndarray  # (k,) s
    robot_clock: ClockQuality
    camera_clock: ClockQuality | None
    counters: dict[str, int]


def motion(config: LatencyConfig, time: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacement in rad and speed in rad/s of the joint: three sines that rise and fall smoothly."""
    time = np.asarray(time, dtype=float)
    angles = np.multiply.outer(time, 2.0 * math.pi * np.array(_FREQUENCIES))
    scale = math.radians(config.amplitude_deg) / len(_FREQUENCIES)
    wave = scale * np.sin(angles).sum(axis=-1)
    rate = scale * (np.cos(angles) * (2.0 * math.pi * np.array(_FREQUENCIES))).sum(axis=-1)
    # A polynomial of fifth degree up, and down again before the end.
    up, up_rate = _rise(time / _RISE)
    down, down_rate = _rise((config.duration - time) / _RISE)
    share, share_rate = up * down, (up_rate * down - up * down_rate) / _RISE
    return share * wave, share * rate + share_rate * wave


def _rise(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2), 30.0 * s**2 * (1.0 - s) ** 2


@undisturbed()
def measure_latency(
    scenario: Scenario,
    robot: RobotModel,
    config: LatencyConfig,
    client: RobotLink,
    camera: PoseSource | None,
    progress: Callable[[float], None] | None = None,
    now: Callable[[], float] = steady_time,
    is_asked_to_end: Callable[[], bool] = never,
) -> LatencyRecord:
    """Moves a joint of a station where it stands, and measures its delays.

    Where a clock was set anew, as that of a virtual cell is which has fallen behind, what came before cannot
    be compared with what follows: the motion goes on until it has lasted as long as wanted since then.

    Args:
        scenario: which station.
        robot: whose joint is moved.
        config: how.
        client: to the controller.
        camera: to the camera server; its clock must be set to no delay. None to do without.
        progress: is called now and then with the share that is done, 0 to 1.
        now: the clock of the client's arrivals, in s.
        is_asked_to_end: whether somebody wants an end.

    However it ends, the robot is sent a smooth stop as long as its controller speaks.

    Raises:
        EndedOnRequest: if somebody wanted an end.
        StationError: if the station is not there or falls silent, its robot does not follow, or its clocks
            are set anew again and again.
        ValueError: if there is no such joint, or the motion would leave its range.
    """
    config.check()
    axis = config.joint - 1
    wire = HardwareLink(client, camera, scenario, robot, False, now, is_asked_to_end)
    wire.connect(camera is not None)
    report = wire.last
    assert report is not None
    start, began, began_here = report.position.copy(), report.time, now()
    _check_room(config, robot, start)
    rows, frames = [], []
    before = client.counters()
    course, steps = config, 0
    sessions = _sessions(wire, camera)
    try:
        while (time := report.time - began) < course.duration:
            displacement, speed = motion(course, time)
            position, velocity = start.copy(), np.zeros(NUM_JOINTS)
            position[axis] += displacement
            velocity[axis] = speed
            wire.send_command(position, velocity)
            rows.append((report.time, position[axis], report.position[axis]))
            sample = wire.poses.newest
            if sample.valid and (not frames or sample.time != frames[-1][0]):
                frames.append((sample.time, *sample.X_WE.translation()))
            if len(rows) % _LOOK == 0:
                if progress:
                    progress(1.0 - (course.duration - time) / config.duration)
                sessions, previous = _sessions(wire, camera), sessions
                if sessions != previous:
                    steps += 1
                    course = replace(config, duration=time + config.duration)
                    if course.duration > _PATIENCE * config.duration:
                        raise StationError(
                            f"the clocks of the station were set anew {steps} times in {time:.0f} s"
                            + wire.host.reason(began_here)
                        )
                    rows.clear()
                    frames.clear()
            if is_asked_to_end():
                raise EndedOnRequest
            following = wire.next_report()
            if following is None or not following.is_ready:
                why = "the controller fell silent" if following is None else "the controller stopped"
                raise StationError(why + wire.host.reason(began_here))
            report = following
    except BaseException:
        wire.stop_smoothly()
        raise
    stamp, commanded, measured = np.array(rows).T
    if np.ptp(measured) < _FOLLOWS * np.ptp(commanded):
        raise StationError(
            f"the robot does not follow: joint {config.joint} was told to move by "
            f"{np.rad2deg(np.ptp(commanded)):.1f} degrees and moved by {np.rad2deg(np.ptp(measured)):.2f}; "
            "does the program of its controller take commands?"
        )
    reported = np.array([wire.robot_clock.station_time(round(1e6 * each)) for each in stamp])
    seen = np.array(frames).reshape(-1, 4)
    counters = client.counters()
    return LatencyRecord(
        stamp,
        commanded,
        measured,
        reported,
        seen[:, 0],
        seen[:, 1:],
        np.array(wire.turn_around),
        wire.robot_clock.quality(),
        camera.report().clock if camera else None,
        {name: number - before[name] for name, number in counters.items()},
    )


def _sessions(wire: HardwareLink, camera: PoseSource | None) -> tuple[int, int]:
    """How often the clocks of controller and camera were set anew."""
    seen = camera.report().clock if camera else None
    return wire.robot_clock.quality().sessions, seen.sessions if seen else 0


def _check_room(config: LatencyConfig, robot: RobotModel, start: np.ndarray) -> None:
    """Raises ValueError if the motion would leave the range of the joint."""
    axis = config.joint - 1
    reach = np.array([-1.0, 1.0]) * math.radians(config.amplitude_deg) + start[axis]
    if reach[0] < robot.lower[axis] or reach[1] > robot.upper[axis]:
        raise ValueError(
            f"latency: joint {config.joint} has no room to move by {config.amplitude_deg} deg here"
        )

"""A controller runs its own path and is sent what the camera says that it lies beside it: path correction.

The controller tells nothing of its path's time; the joints say where on the path the robot is. What is sent
is the difference between where the joints put the tool and where the camera saw it at the same instant, as
seen in the path's frame: it does not depend on what was sent before, so no delay can make it unstable. What
lies along the path cannot be corrected, and appears across it behind the next corner.

Both sides must be on the same side of a corner, for there the frame turns at once: a correction for the edge
before it, taken in the frame of the edge behind it, throws the tool off by as much as it should mend. Which
frame the controller uses is told from where the joints have put the tool with what it was sent.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from diagrams.hardware_link import HardwareLink, StationError, never
from diagrams.runs.undisturbed import undisturbed
from diagrams.scenario.scenario import Scenario
from robots.description.model import RobotModel
from robots.dynamics.compliant_kinematics import CompliantKinematics
from systems.link.abb.controller import EgmRunConfig
from systems.link.clock import steady_time
from systems.link.protocols import PoseSource, RobotLink
from systems.reference.path_frame import PathLine
from systems.reference.paths import make_path

_LARGEST = 0.05  # m, that is ever asked for in a direction
_SILENCE = 1.0  # s that end a pass; meanwhile the controller goes on, or stops by its own time-out
_SMOOTHING = 0.05  # s, of what the camera says: twelve exposures at 4 ms
_KEPT = 1.0  # s, for which it is known where the joints were
_NEAR_END = 0.005  # m before the end of the path, from which a controller that stops has finished it
_STANDS = 20.0  # s beside rests of the path, in which a robot that runs it has moved on by the way above
_FAR = 0.1  # m beside the path: the robot runs another one
REQUESTED = "ended on request"


class CorrectedRobot(RobotLink, Protocol):
    """A controller that takes corrections of its own path."""

    def correct(self, shift_P: np.ndarray) -> bool:
        """Answers the newest report with a shift (3,) in m, in the frame of the path."""
        ...


@dataclass(frozen=True)
class CorrectedPass:
    """One pass along the path; n exposures of the camera, m reports of the controller."""

    along: np.ndarray  # (n,) m, where the exposures were
    beside: np.ndarray  # (n, 2) m, from the tool to the path by the camera, along y and z of the path's frame
    asked: np.ndarray  # (n, 2) m, correction that was sent then
    stamps: np.ndarray  # (m,) s, the controller's clock
    joints: np.ndarray  # (m, 6) rad
    places: np.ndarray  # (m,) of the line, where the joints say that the robot was on its way
    length: float  # m, of the path
    ended: str  # why: "path", or what broke off


class PathCorrectionRun:
    """Corrects the path of a controller for one pass."""

    def __init__(self, scenario: Scenario, robot: RobotModel) -> None:
        """Takes what to do.

        Raises:
            ValueError: if the path has no length, the station none of the camera's poses, or its controller
                takes no path corrections.
        """
        if not scenario.station.link.has_camera:
            raise ValueError("path correction needs a camera: station.link.has_camera is false")
        program = scenario.station.link.run
        if not isinstance(program, EgmRunConfig):
            raise ValueError(
                f"path correction is of ABB's EGM, the station speaks {scenario.station.link.title}"
            )
        self._scenario, self._robot, self._lag = scenario, robot, program.correction_lag
        self._line = PathLine(make_path(scenario.reference))
        self._kinematics = CompliantKinematics(robot, scenario.station.payload)

    @undisturbed()
    def run(
        self,
        client: CorrectedRobot,
        camera: PoseSource,
        corrects: bool = True,
        progress: Callable[[float], None] | None = None,
        now: Callable[[], float] = steady_time,
        is_asked_to_end: Callable[[], bool] = never,
    ) -> CorrectedPass:
        """Follows the robot along its path until the controller is done.

        Args:
            client: to the controller.
            camera: to the camera server.
            corrects: False to send corrections of zero, as a pass to compare with.
            progress: is called with the share of the path that is done.
            now: the clock of the client's arrivals, in s.
            is_asked_to_end: whether somebody wants an end: corrections end, and the controller's own time-out
                stops the robot.

        Raises:
            EndedOnRequest: if somebody wanted an end before the path began.
            StationError: if the station is not there, or its robot is elsewhere.
        """
        wire = HardwareLink(client, camera, self._scenario, self._robot, False, now, is_asked_to_end)
        wire.connect(needs_camera=True)
        wire.start_path()
        seen: list[np.ndarray] = []
        reports: list[np.ndarray] = []
        shift_W, robot_at, camera_at, exposed = np.zeros(3), 0, 0, -math.inf
        taken = _TakenUp(self._lag)
        nominal: deque[np.ndarray] = deque()  # time in s, and where the joints put the tool in m
        began, began_here, ended = None, now(), ""
        reference = self._scenario.reference
        rest, moved_at, moved = _STANDS + max(reference.settle, reference.dwell), began_here, 0.0
        while not ended:
            if is_asked_to_end():
                ended = REQUESTED
                break
            report = wire.next_report(wait=_SILENCE)
            if report is None or not report.is_ready:
                left = self._line.length - self._line.way_to(robot_at)
                ended = "path"
                if left >= _NEAR_END:
                    why = wire.trouble or _broken(report is None, left)
                    ended = why + wire.host.reason(began_here)
                break
            began = report.time if began is None else began
            time, tip = report.time - began, self._kinematics.forward(report.position)[:3, 3]
            nominal.append(np.array([time, *tip]))
            while nominal[0][0] < time - _KEPT:
                nominal.popleft()
            place = self._line.shifted(tip, robot_at, partial(taken.up_to, time))
            robot_at = place.index
            taken.note(time, place.R_WP)
            if place.along > moved + _NEAR_END:
                moved_at, moved = now(), place.along
            elif now() > moved_at + rest:
                ended = f"the robot has not moved on for {rest:.0f} s; does its controller run the path?"
                break
            sample = wire.pose_at(time)
            if sample.valid and sample.time > exposed:
                share = 1.0 if math.isinf(exposed) else 1.0 - math.exp((exposed - sample.time) / _SMOOTHING)
                exposed = sample.time
                seen_at = self._line.place(sample.X_WE.translation(), camera_at)
                camera_at = seen_at.index
                _require_near(seen_at.p_error_W)
                if corrects:
                    off_W = _at(nominal, sample.time) - sample.X_WE.translation()
                    shift_W = np.clip(shift_W + share * (off_W - shift_W), -_LARGEST, _LARGEST)
                across = seen_at.R_WP[:, 1:]
                seen.append(np.array([seen_at.along, *(seen_at.p_error_W @ across), *(shift_W @ across)]))
            # Only what lies across the path where the robot is now can be taken up.
            asked_P = np.array([0.0, *(place.R_WP.T @ shift_W)[1:]])
            client.correct(asked_P)
            taken.asked_P = asked_P
            reports.append(np.array([report.time, *report.position, robot_at]))
            if progress:
                progress(place.along / self._line.length)
        rows, log = np.array(seen).reshape(-1, 5), np.array(reports).reshape(-1, 8)
        joints, places = log[:, 1:7], log[:, 7].astype(int)
        length = self._line.length
        return CorrectedPass(rows[:, 0], rows[:, 1:3], rows[:, 3:], log[:, 0], joints, places, length, ended)

    def beside(self, p_WE: np.ndarray) -> np.ndarray:
        """How far points (n, 3) of a pass in m, in their order, lie beside the path: (n, 2) along y and z."""
        found, index = np.zeros((len(p_WE), 2)), 0
        for row, point in zip(found, p_WE, strict=True):
            place = self._line.place(point, index)
            index, row[:] = place.index, place.p_error_W @ place.R_WP[:, 1:]
        return found

    def across(self, p_WE: np.ndarray, places: np.ndarray) -> np.ndarray:
        """How far points (n, 3) in m lie across the edges that the robot is on: (n, 2) along y and z.

        At a corner the tool may be beside the edge that the robot has left, by what lies along the one that
        it is on. No path correction takes that away, and it does not count here.

        Args:
            p_WE: of a pass, in their order.
            places: (n,) of the line, where the robot was.
        """
        found, index = np.zeros((len(p_WE), 2)), 0
        for row, point, robot_at in zip(found, p_WE, places, strict=True):
            index = self._line.place(point, index).index
            (seen, _), (moved, _) = self._line.row(index), self._line.row(robot_at)
            row[:] = (self._line.points[seen] - point) @ self._line.R_WP[moved, :, 1:]
        return found


class _TakenUp:
    """What a controller has taken up of the corrections that it was sent, with a lag in s."""

    def __init__(self, lag: float) -> None:
        self.asked_P = np.zeros(3)  # m, the newest
        self._lag, self._shift_W, self._time = lag, np.zeros(3), -math.inf

    def up_to(self, time: float, R_WP: np.ndarray) -> np.ndarray:
        """The shifts (..., 3) in m in the world at a time in s, had it used frames (..., 3, 3) since."""
        share = 1.0 - math.exp((self._time - time) / self._lag) if self._lag else 1.0
        return self._shift_W + share * (R_WP @ self.asked_P - self._shift_W)

    def note(self, time: float, R_WP: np.ndarray) -> None:
        """Which frame (3, 3) it has used until a time in s that never goes back."""
        self._shift_W, self._time = self.up_to(time, R_WP), time


def _at(kept: Sequence[np.ndarray], time: float) -> np.ndarray:
    """A position (3,) in m between rows of a time in s and a position."""
    rows = np.array(kept)
    return np.array([np.interp(time, rows[:, 0], column) for column in rows[:, 1:].T])


def _broken(is_silent: bool, left: float) -> str:
    what = "the controller fell silent" if is_silent else "the controller stopped"
    return f"{what} {1e3 * left:.0f} mm before the end of the path"


def _require_near(error_W: np.ndarray) -> None:
    distance = float(np.linalg.norm(error_W))
    if distance > _FAR:
        raise StationError(
            f"path correction: the tool is {1e3 * distance:.0f} mm from the path of the scenario; does the "
            "controller run that path, and is its camera frame right?"
        )

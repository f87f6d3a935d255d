"""A tool that is knocked out of its place while the robot moves: what the camera sees of it makes a step."""

import importlib
import math

import numpy as np

from robots.description.model import RobotModel
from robots.metrology.step_detection import StepDetector
from robots.pose import pose_error
from systems.guard.config import GuardConfig
from systems.link.protocols import RobotReport
from systems.samples import PoseSample

DISPLACED = "tool_displaced"  # the kind of the event
_FLANK = 1.9e-4  # rad, by which a gear that changes its flank turns the arm: smaller steps are such ones
_GAP = 0.1  # s between samples, in which a robot gets so far that a bend looks like a step
_KEPT = 128  # joint positions, the newest: half a second at 250 Hz


class ToolWatch:
    """Compares poses of the camera with the joints at their exposures, one after the other.

    A robot that is not calibrated is off by a bend along its way, in the frame of the tool too; a tool that
    is displaced is off by a step in it. A camera that is knocked makes such a step as well. Clocks of robot
    and camera may be apart, as where stamps of joints are late: what is off by the speed of the tool is none.
    It begins anew after a gap in the samples.
    """

    def __init__(self, robot: RobotModel) -> None:
        """``robot`` is the one that the controller believes in."""
        # With numba, which takes time to be imported.
        self._kinematics = importlib.import_module("robots.kinematics.compiled").CompiledKinematics(robot)
        self._joints = np.full((_KEPT, 1 + len(robot.joints)), np.nan)
        beyond = [*(joint.placement for joint in robot.joints[2:]), robot.tool]  # the second joint
        length = sum(float(np.linalg.norm(each.pose().translation())) for each in beyond)
        self._least = _FLANK * length
        self._count, self._last, self._steps = 0, -np.inf, StepDetector(self._least)

    def contradiction(self, report: RobotReport | None, sample: PoseSample, guard: GuardConfig) -> str:
        """What is wrong if a robot that stands is seen elsewhere than its joints say, before it is moved.

        No sample so far off would be used on the path. The robot would be moved to its start all the same,
        with joints in another unit or of another robot even faster than it may.

        Returns:
            That the tool is seen farther from where the joints put it than the guard allows; empty if not.
        """
        if not sample.valid or report is None:
            return ""
        X_WE = np.eye(4)
        X_WE[:3] = self._kinematics.rows_and_jacobian(report.position)[0]
        error = pose_error(X_WE, sample.X_WE.GetAsMatrix4())
        angle, distance = math.degrees(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))
        if distance <= guard.largest_deviation and angle <= guard.largest_deviation_deg:
            return ""
        return (
            f"the camera sees the tool {distance:.3g} m and {angle:.3g} degrees from where the joints put "
            f"it, servo.guard.largest_deviation is {guard.largest_deviation:g} m and "
            f"{guard.largest_deviation_deg:g} degrees: check camera_frame, tool_frame and the body in "
            "station.link, the robot, and the joints that its controller sends"
        )

    def note(self, time: float, position: np.ndarray, sample: PoseSample) -> tuple[str, str] | None:
        """The joints (6,) in rad at a time in s, and the newest sample of the camera then.

        Returns:
            Kind and detail of an event, if one is known now.
        """
        row = self._joints[self._count % _KEPT]
        row[0], row[1:] = time, position
        self._count += 1
        if not sample.valid or sample.time <= self._last or self._count < 2:
            return None
        if sample.time - self._last > _GAP:
            self._steps = StepDetector(self._least)
        self._last = sample.time
        deviation = self._deviation(sample)
        found = None if deviation is None else self._steps.add(sample.time, *deviation)
        if found is None:
            return None
        size, sigma = 1e3 * float(np.linalg.norm(found.size)), 1e3 * found.sigma
        return DISPLACED, (
            f"since {found.onset:.3f} s by {size:.2f} mm, standard deviation {sigma:.2f}: check the tool, or "
            "the camera if it was touched"
        )

    def _deviation(self, sample: PoseSample) -> tuple[np.ndarray, np.ndarray] | None:
        """Seen less believed place of the tool in its frame, m, and how fast it moves in it, m/s, (3,) each.

        None if the joints are not known.
        """
        kept = np.roll(self._joints, -(self._count % _KEPT), axis=0)[-min(self._count, _KEPT) :]
        after = int(np.searchsorted(kept[:, 0], sample.time))
        if not 0 < after < len(kept):
            return None
        before, behind = kept[after - 1], kept[after]
        passed, moved = behind[0] - before[0], behind[1:] - before[1:]
        share = (sample.time - before[0]) / passed
        X_WE, J = self._kinematics.rows_and_jacobian(before[1:] + share * moved)
        R_EW = X_WE[:, :3].T
        return R_EW @ (sample.X_WE.translation() - X_WE[:, 3]), R_EW @ J[3:] @ moved / passed

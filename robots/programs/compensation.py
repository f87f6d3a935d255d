"""False targets: where a controller with the nominal model has to be sent for the true robot to arrive.

A target X of the program is reached by the calibrated robot at the joint positions q* with f_true(q*) = X.
The controller thinks in the nominal model, so the program is given f_nominal(q*), or q* itself where it gives
joint positions. The numbers of the configuration follow where a joint comes into another quarter.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robots.description.model import Placement, RobotModel
from robots.dynamics.compliant_kinematics import controller_kinematics
from robots.dynamics.newton_inverse import inverse_kinematics
from robots.kinematics.analytic_inverse import InverseKinematics
from robots.kinematics.forward import Kinematics
from robots.kinematics.numeric_inverse import NumericInverse
from robots.pose import pose_error, rotation_from_zyx, zyx_from_rotation
from robots.programs.configuration import Branch, differences, rewritten, says_configuration, turns_within
from robots.programs.program import Literal, Program, Target

# At zero joint angles the flanges of ABB and KUKA look ahead: z forward, x down, seen from the base.
FLANGE_AHEAD = rotation_from_zyx(np.array([0.0, 0.5 * np.pi, 0.0]))
_SAME_TOOL = 1e-6  # m, of its centre: then it is the one that the calibration measured
_FAR = np.deg2rad(10.0)  # of a joint: then the target is near a singularity
_BRANCHES: list[Branch] = [
    (c1, c2, c5) for c1 in (False, True) for c2 in (False, True) for c5 in (False, True)
]


@dataclass(frozen=True)
class FalseTarget:
    """A target with what is written in its place."""

    target: Target
    X_WT: np.ndarray  # (4, 4) where the tool is wanted
    q_before: np.ndarray  # (6,) rad, where the controller would send the robot with the old numbers
    q_after: np.ndarray  # (6,) where it does with the new ones
    error_before: np.ndarray  # (6,) rad, m: wanted less true, as a rotation vector above a translation
    shift: np.ndarray  # (6,) rad, m: new less old target, in the base of the target
    edits: dict[Literal, str]
    payload: float  # kg
    margin: float  # rad, of the joint that is nearest to its limit
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class Refusal:
    """A target that the true robot cannot reach, or the controller cannot."""

    target: Target
    why: str


class Compensation:
    """Corrects programs for one robot."""

    def __init__(self, nominal: RobotModel, calibrated: RobotModel, payload: float | None = None) -> None:
        """Puts the calibrated robot into the world of the nominal one.

        Args:
            nominal: what the controller computes with.
            calibrated: the same robot as it is.
            payload: kg, for all targets; None for what the program says, and zero where it says nothing.

        Raises:
            ValueError: if the inverse kinematics of one of them cannot be solved.
        """
        self._nominal, self._true, self._payload = nominal, _in_world(calibrated), payload
        self._arms: dict[tuple[bytes, float], _Arm] = {}
        self._arm(None, 0.0)  # refuses a robot that cannot be solved

    @property
    def is_compliant(self) -> bool:
        """Whether the load counts."""
        return bool(self._true.compliance.any())

    def false_targets(
        self, program: Program, q_near: np.ndarray, progress: Callable[[float], None] | None = None
    ) -> list[FalseTarget | Refusal]:
        """All targets of a program, in its order.

        Args:
            program: what is to be corrected.
            q_near: joint positions in rad, (6,), from which the first target is reached; each further one is
                near the one before, where it does not say its configuration.
            progress: is called with the share that is done.
        """
        results: list[FalseTarget | Refusal] = []
        for number, target in enumerate(program.targets, 1):
            try:
                found = self._false_target(target, q_near)
                q_near = found.q_before
            except ValueError as error:
                found = Refusal(target, str(error))
            results.append(found)
            if progress:
                progress(number / len(program.targets))
        return results

    def errors(self, rewritten: Program, results: list[FalseTarget]) -> np.ndarray:
        """Wanted less true poses when the controller runs a corrected program, (n, 6) in rad and m.

        Args:
            rewritten: the corrected program as its file says it, read anew.
            results: what was wanted of each target.
        """
        errors = np.zeros((len(results), 6))
        for row, (target, wanted) in enumerate(zip(rewritten.targets, results, strict=True)):
            arm = self._arm(target.tool.X if target.tool else None, wanted.payload)
            q = target.q if target.has_joints else arm.choose(target, wanted.q_after)[0]
            errors[row] = pose_error(wanted.X_WT, arm.true.forward(q))
        return errors

    def _false_target(self, target: Target, q_near: np.ndarray) -> FalseTarget:
        payload = self._load(target)
        arm = self._arm(target.tool.X if target.tool else None, payload)
        remarks = []
        if target.has_joints:
            q_before = target.q
            arm.refuse_beyond_limits(q_before)
            X_WT = arm.nominal.forward(q_before)
        else:
            X_WT = target.base.X @ target.X_BT
            q_before, is_as_said = arm.choose(target, q_near)
            if not is_as_said:
                remarks.append("no solution has the configuration that is written; the nearest was taken")
        q_after = arm.inverse_of_true.nearest(X_WT, q_before)
        moved = np.abs(q_after - q_before)
        if moved.max() > _FAR:
            joint = int(np.argmax(moved))
            remarks.append(
                f"near a singularity: joint {joint + 1} moves by {np.rad2deg(moved[joint]):.1f} deg"
            )
        if target.has_joints:
            X_new, X_old, edits = arm.nominal.forward(q_after), X_WT, target.driven(q_after)
        else:
            X_new, X_old = np.linalg.inv(target.base.X) @ arm.nominal.forward(q_after), target.X_BT
            edits = target.moved(X_new) | rewritten(target, q_before.tolist(), q_after.tolist())
        limits = np.minimum(q_after - self._nominal.lower, self._nominal.upper - q_after)
        return FalseTarget(
            target, X_WT, q_before, q_after, pose_error(X_WT, arm.true.forward(q_before)),
            pose_error(X_new, X_old), edits, payload, float(limits.min()), tuple(remarks),
        )  # fmt: skip

    def _load(self, target: Target) -> float:
        if self._payload is not None:
            return self._payload
        if target.load_unread and self.is_compliant:
            raise ValueError(f"{target.load_unread}; --payload says one load for all")
        if len(target.payloads) > 1 and self.is_compliant:
            loads = ", ".join(f"{each:g}" for each in target.payloads)
            raise ValueError(f"moved to with loads of {loads} kg, under which the robot bends differently")
        return target.payloads[0] if target.payloads and self.is_compliant else 0.0

    def _arm(self, X_0T: np.ndarray | None, payload: float) -> "_Arm":
        """The robot with a tool, which may be that of the robot file, and a load."""
        key = (b"" if X_0T is None else X_0T.tobytes(), payload)
        if key not in self._arms:
            X_FE, X_FE_true = (robot.tool.pose().GetAsMatrix4() for robot in (self._nominal, self._true))
            X_FT = X_FE if X_0T is None else self._flange @ X_0T
            is_measured = np.linalg.norm(X_FT[:3, 3] - X_FE[:3, 3]) < _SAME_TOOL
            X_FT_true = X_FE_true @ np.linalg.inv(X_FE) @ X_FT if is_measured else X_FT
            pair = (_with_tool(self._nominal, X_FT), _with_tool(self._true, X_FT_true))
            self._arms[key] = _Arm(*pair, payload)
        return self._arms[key]

    def uses_measured_tool(self, target: Target) -> bool:
        """Whether the tool of a target is the one that the calibration measured."""
        if target.tool is None:
            return True
        apart = (self._flange @ target.tool.X)[:3, 3] - self._nominal.tool.translation
        return bool(np.linalg.norm(apart) < _SAME_TOOL)

    @cached_property
    def _flange(self) -> np.ndarray:
        """The flange as the controller has it, in the frame of link 6."""
        X = np.eye(4)
        R_WB = self._nominal.base.pose().rotation().matrix()
        R_WF = Kinematics(_with_tool(self._nominal, np.eye(4))).forward(np.zeros(6))[:3, :3]
        X[:3, :3] = R_WF.T @ R_WB @ FLANGE_AHEAD
        return X


class _Arm:
    """The nominal and the true robot with one tool and one load."""

    def __init__(self, nominal: RobotModel, true: RobotModel, payload: float) -> None:
        self._robot = nominal
        self.nominal = Kinematics(nominal)
        self.true = controller_kinematics(true, payload)
        inverse = inverse_kinematics(nominal)
        assert isinstance(inverse, InverseKinematics | NumericInverse)
        self._inverse = inverse
        self.inverse_of_true = inverse_kinematics(true, payload)

    def choose(self, target: Target, q_near: np.ndarray) -> tuple[np.ndarray, bool]:
        """Where the controller sends the robot for a pose, (6,), and whether it is as the target says.

        Raises:
            ValueError: if it is out of reach or beyond the limits.
        """
        X_WT = target.base.X @ target.X_BT
        best, least = None, (99, 99, np.inf)
        found = self._inverse.all_branches(X_WT)
        # Only of arms with a wrist in one point do makers number the branches.
        branches = _BRANCHES if isinstance(self._inverse, InverseKinematics) else [None] * len(found)
        for branch, q in zip(branches, found, strict=True):
            if np.isnan(q).any():
                continue
            for turned in turns_within(q, self._robot.lower, self._robot.upper):
                sign = branch and (branch[0], branch[1], turned[4] < 0.0)
                far = float(np.sum((np.array(turned) - q_near) ** 2))
                rank = (*differences(target, turned, sign), far)
                if rank < least:
                    best, least = np.array(turned), rank
        near = self._inverse.nearest(X_WT, q_near)  # raises where there is no solution at all
        # Where the wrist is stretched the branches leave axis 4 at zero; the nearest keeps it where it was.
        if best is None or (abs(near[4]) < 1e-9 and differences(target, near.tolist(), None)[0] <= least[0]):
            best, least = near, (differences(target, near.tolist(), None)[0], 0, 0.0)
        return best, least[0] == 0 or not says_configuration(target)

    def refuse_beyond_limits(self, q: np.ndarray) -> None:
        """Raises ValueError if a joint is beyond its limits."""
        lower, upper = self._robot.lower, self._robot.upper
        for joint, (angle, least, most) in enumerate(zip(q, lower, upper, strict=True), 1):
            if not least - 1e-9 <= angle <= most + 1e-9:
                raise ValueError(
                    f"joint {joint} is at {np.rad2deg(angle):.2f} deg, "
                    f"allowed are {np.rad2deg(least):g} to {np.rad2deg(most):g} deg"
                )


def _in_world(calibrated: RobotModel) -> RobotModel:
    """The robot with its base in the world, not in the frame of the instrument that measured it."""
    calibration = calibrated.calibration
    X_IW = np.eye(4)
    X_IW[:3, :3] = rotation_from_zyx(np.deg2rad(calibration.frame_zyx_deg))
    X_IW[:3, 3] = calibration.frame_translation
    X_WB = np.linalg.inv(X_IW) @ calibrated.base.pose().GetAsMatrix4()
    return replace(calibrated, base=_placement(X_WB, calibrated.base.source))


def _with_tool(robot: RobotModel, X_FT: np.ndarray) -> RobotModel:
    return replace(robot, tool=_placement(X_FT, "the tool of a program"))


def _placement(X: np.ndarray, source: str) -> Placement:
    return Placement(X[:3, 3].copy(), np.rad2deg(zyx_from_rotation(X[:3, :3])), source)

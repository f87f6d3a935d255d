"""Checks of a station, one a day, and the alarms that follow from their history."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from diagrams.scenario.scenario import Scenario
from experiments.health.check import (
    BLOCKS,
    FRAME_RATE,
    PER_BLOCK,
    PIXEL_SIGMA,
    CameraTurn,
    Check,
    measure_check,
)
from experiments.health.history import History, new_history
from robots.description.model import NUM_JOINTS, RobotModel
from robots.measurement_design.constraints import AdmissibleConfigurations
from robots.metrology.change_detection import cusum_changes
from robots.metrology.daily_check import TOOL, CheckNoise, check_poses, find_drift
from robots.pose import pose_error
from systems.vision.camera_rig import load_cell
from systems.vision.reference_markers import SHIPPED, ReferenceMarkers

DAY = 86400.0  # s
NOISE = CheckNoise(position=30e-6, rotation=np.deg2rad(0.005))  # of a pose at rest; assumed
_SUGGESTIONS = {
    "camera": "recalibrate the camera",
    "joint zero": "run the full calibration",
    "tool": "check the tool for a collision or a change",
}
KINDS = ("joint", "tool", "camera")


@dataclass(frozen=True)
class Injected:
    """A change of the simulated station: joint:3:40 (mdeg), tool:0.2 (mm) or camera:04:50 (microradians)."""

    kind: str
    what: str
    size: float  # rad or m

    @classmethod
    def parse(cls, text: str, cameras: tuple[str, ...]) -> "Injected":
        """Reads what an option says. Raises ValueError if it says nothing that can be simulated."""
        kind, *rest = text.split(":")
        form = "joint:N:MDEG, tool:MM or camera:NAME:MICRORADIANS"
        try:
            size = float(rest[-1])
        except (IndexError, ValueError):
            raise ValueError(f"--change must be {form}, got '{text}'") from None
        if kind == "tool" and len(rest) == 1:
            return cls(kind, "", 1e-3 * size)
        if kind == "joint" and len(rest) == 2 and rest[0] in map(str, range(1, NUM_JOINTS + 1)):
            return cls(kind, rest[0], float(np.deg2rad(1e-3 * size)))
        if kind == "camera" and len(rest) == 2:
            if rest[0] not in cameras:
                raise ValueError(f"--change {text}: the cameras are {', '.join(cameras)}, got '{rest[0]}'")
            return cls(kind, rest[0], 1e-6 * size)
        raise ValueError(f"--change must be {form}, got '{text}'")

    def station(self, scenario: Scenario) -> Scenario:
        """The scenario with the change in its true robot."""
        errors = scenario.station.errors
        if self.kind == "joint":
            offset = errors.joint_offset_deg.copy()
            offset[int(self.what) - 1] += np.rad2deg(self.size)
            errors = replace(errors, joint_offset_deg=offset)
        elif self.kind == "tool":
            shift = np.array([1e3 * self.size, 0.0, 0.0])
            errors = replace(errors, tool_translation_mm=errors.tool_translation_mm + shift)
        return replace(scenario, station=replace(scenario.station, errors=errors))


class HealthStudy:
    """A station that is checked once a day."""

    def __init__(self, scenario: Scenario, robot: RobotModel, cell: str = "probst") -> None:
        """Chooses the poses. Raises ValueError if too few are admissible or the cell is unknown."""
        self._scenario, self._robot = scenario, robot
        rig = load_cell(cell)
        self.names = tuple(camera.name for camera in rig.cameras)
        X_WB = robot.base.pose()
        self._cameras = rig.camera_model(X_WB)
        self._p_W = SHIPPED @ X_WB.rotation().matrix().T + X_WB.translation()
        self._markers = ReferenceMarkers(self._cameras, self._p_W, PIXEL_SIGMA)
        self._q = check_poses(robot, AdmissibleConfigurations(robot))

    def begun(self) -> History:
        """A history without a check."""
        return new_history(self._robot.name, self.names, self._q)

    def continued(
        self,
        history: History,
        checks: int,
        injected: Injected | None,
        change_at: int,
        progress: Callable[[float], None],
    ) -> History:
        """The history after more checks, one a day.

        Args:
            history: so far.
            checks: how many more.
            injected: what changes in the simulated station; None for nothing.
            change_at: the number of the check, from one, in which it changes.
            progress: is called with the share that is done.

        Raises:
            ValueError: if the history is that of another robot, cell or set of poses.
        """
        if (history.robot, history.cameras) != (self._robot.name, self.names):
            raise ValueError(
                f"the history is of {history.robot} with {len(history.cameras)} cameras, not of "
                f"{self._robot.name} with {len(self.names)}"
            )
        if not np.allclose(history.q, self._q, atol=1e-6):
            raise ValueError("the history has other poses than this robot would be checked in")
        for k in range(checks):
            number = len(history.time) + 1
            has_changed = injected is not None and number >= change_at
            scenario = injected.station(self._scenario) if injected and has_changed else self._scenario
            turn = None
            if injected and has_changed and injected.kind == "camera":
                at = 1.0 if number == change_at else 0.0
                turn = CameraTurn(self.names.index(injected.what), injected.size, at)
            check = measure_check(
                scenario, self._q, self._cameras, self._markers, self._p_W, turn,
                self._scenario.seed + number, lambda share, done=k: progress((done + share) / checks),
            )  # fmt: skip
            time = DAY * (number - 1)
            history = history.appended(
                time, check.X_WE, check.rotations.mean(axis=0), self._camera_alarms(check, time)
            )
        return history

    def alarms(self, history: History) -> list[dict[str, Any]]:
        """What has changed: cameras by their first alarm, and the cause of deviations of the poses."""
        found: dict[str, dict[str, Any]] = {}
        for each in history.alarms:
            for alarm in each:
                found.setdefault(alarm["what"], alarm)
        drift = find_drift(self._robot, history.q, deviations(history), NOISE)
        if drift is not None:
            kind = TOOL if drift.what == TOOL else "joint zero"
            onset = float(history.time[drift.onset])
            found[drift.what] = _alarm(kind, drift.what, onset, drift.size, drift.sigma)
        return list(found.values())

    def _camera_alarms(self, check: Check, time: float) -> list[dict[str, Any]]:
        """The cameras that have turned, in the order in which that was known."""
        white = np.sqrt(PER_BLOCK) * self._markers.whitened(check.rotations).reshape(BLOCKS, -1)
        found: dict[int, dict[str, Any]] = {}
        for change in cusum_changes(white):
            camera = change.channel // 3
            since = check.rotations[change.onset :, camera]
            size = float(np.linalg.norm(since.mean(axis=0)))
            spread = self._markers.covariance[camera] / (PER_BLOCK * len(since))
            onset = time + change.onset * PER_BLOCK / FRAME_RATE
            name = f"camera {self.names[camera]}"
            sigma = float(np.sqrt(np.linalg.eigvalsh(spread)[-1]))
            found.setdefault(camera, _alarm("camera", name, onset, size, sigma))
        return list(found.values())


def deviations(history: History) -> np.ndarray:
    """Of the poses of every check from those of the first, (n, 6, 6), rotation first."""
    return np.array([pose_error(each, history.X_WE[0]) for each in history.X_WE])


def _alarm(kind: str, what: str, onset: float, size: float, sigma: float) -> dict[str, Any]:
    unit = "m" if kind == TOOL else "rad"
    return {
        "kind": kind,
        "what": what,
        "onset_s": onset,
        "size": size,
        "sigma": sigma,
        "unit": unit,
        "suggestion": _SUGGESTIONS[kind],
    }

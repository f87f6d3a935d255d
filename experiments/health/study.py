"""Checks of a station, one a day, and the alarms that follow from their history."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from diagrams.scenario.scenario import Scenario
from experiments.cameras.accuracy import Places
from experiments.cameras.budget import lone_markers
from experiments.health.check import (
    BLOCKS,
    FRAME_RATE,
    PER_BLOCK,
    PIXEL_SIGMA,
    BentArm,
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
from systems.vision.marker_body import load_body
from systems.vision.marker_displacement import check_markers
from systems.vision.reference_markers import SHIPPED, ReferenceMarkers

DAY = 86400.0  # s
NOISE = CheckNoise(position=30e-6, rotation=np.deg2rad(0.005))  # of a pose at rest; assumed
_CLOCK = 1e9  # s: later times are those of a clock and not of a simulation
_MISFIT = 8.0  # standard deviations, from which residuals of the body are no noise
_SUGGESTIONS = {
    "camera": "recalibrate the camera",
    "joint zero": "run the full calibration",
    "tool": "check the tool for a collision or a change",
    "marker": "straighten or replace it and measure the body anew",
}


@dataclass(frozen=True)
class Injected:
    """A change of the simulated station.

    joint:3:40 (mdeg), tool:0.2 (mm), camera:04:50 (microradians), marker:5:0.1 (mm) or marker:5:lost.
    """

    kind: str
    what: str
    size: float  # rad or m

    @classmethod
    def parse(cls, text: str, cameras: tuple[str, ...]) -> "Injected":
        """Reads what an option says. Raises ValueError if it says nothing that can be simulated."""
        kind, *rest = text.split(":")
        form = "joint:N:MDEG, tool:MM, camera:NAME:MICRORADIANS or marker:N:MM|lost"
        try:
            size = float(np.inf if [kind, rest[-1]] == ["marker", "lost"] else rest[-1])
        except (IndexError, ValueError):
            raise ValueError(f"--change must be {form}, got '{text}'") from None
        if not np.isfinite(size) and rest[-1] != "lost":
            raise ValueError(f"--change {text}: the size must be a finite number, got '{rest[-1]}'")
        if kind == "tool" and len(rest) == 1:
            return cls(kind, "", 1e-3 * size)
        if kind == "joint" and len(rest) == 2:
            if rest[0] not in map(str, range(1, NUM_JOINTS + 1)):
                raise ValueError(f"--change {text}: the joints are 1 to {NUM_JOINTS}, got '{rest[0]}'")
            return cls(kind, rest[0], float(np.deg2rad(1e-3 * size)))
        if kind == "camera" and len(rest) == 2:
            if rest[0] not in cameras:
                raise ValueError(f"--change {text}: the cameras are {', '.join(cameras)}, got '{rest[0]}'")
            return cls(kind, rest[0], 1e-6 * size)
        if kind == "marker" and len(rest) == 2 and rest[0].isdigit():
            return cls(kind, rest[0], 1e-3 * size)
        raise ValueError(f"--change must be {form}, got '{text}'")

    @property
    def is_of_robot(self) -> bool:
        """Whether it is the true robot that changes, and not what sees it."""
        return self.kind in ("joint", "tool")

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
        self._rig, self._body = rig, load_body("probst")

    def begun(self) -> History:
        """A history without a check."""
        return new_history(self._robot.name, self.names, self._q, self._calibration)

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
        self.refuse(history, is_simulated=True)
        for k in range(checks):
            number = len(history.time) + 1
            has_changed = injected is not None and number >= change_at
            scenario = injected.station(self._scenario) if injected and has_changed else self._scenario
            changed = self._changed(injected, number == change_at) if injected and has_changed else None
            check = measure_check(
                scenario, self._q, self._cameras, self._markers, self._p_W, self._body.p_E, changed,
                self._scenario.seed + number, lambda share, done=k: progress((done + share) / checks),
            )  # fmt: skip
            time = DAY * (number - 1)
            # A camera that has turned spoils residuals of the body: it is named first.
            alarms = self._camera_alarms(check, time) or self._marker_alarms(check, time)
            history = history.appended(time, check.X_WE, check.rotations.mean(axis=0), alarms)
        return history

    @property
    def _calibration(self) -> np.ndarray:
        """Where the cameras stand in the frame of the robot's base, and their lenses, (n, 21)."""
        cameras = self._rig.camera_model()
        lens = (cameras.focal, cameras.center, cameras.radial, cameras.tangential)
        return np.hstack([cameras.p_WC, cameras.R_WC.reshape(-1, 9), *lens])

    @property
    def q(self) -> np.ndarray:
        """The configurations of a check in rad, (6, 6)."""
        return self._q

    def refuse(self, history: History, is_simulated: bool) -> None:
        """Refuses a history that cannot be continued.

        Args:
            history: so far.
            is_simulated: whether the next check is.

        Raises:
            ValueError: if it is that of another robot, cell or set of poses, or of a station of another kind.
        """
        if (history.robot, history.cameras) != (self._robot.name, self.names):
            raise ValueError(
                f"the history is of {history.robot} with {len(history.cameras)} cameras, not of "
                f"{self._robot.name} with {len(self.names)}"
            )
        known = history.calibration
        if known is not None:
            others = np.flatnonzero(~np.isclose(known, self._calibration, rtol=1e-9, atol=1e-9).all(axis=1))
            if len(others):
                names = ", ".join(self.names[i] for i in others)
                raise ValueError(
                    "the history is of cameras of these names that stand elsewhere or have other lenses: "
                    f"{names}; begin another with --history once cameras have been calibrated anew"
                )
        if not np.allclose(history.q, self._q, atol=1e-6):
            raise ValueError("the history has other poses than this robot would be checked in")
        if len(history.time) and (history.time[0] < _CLOCK) != is_simulated:
            raise ValueError(
                "a history of simulated checks cannot be continued on a station, nor the other way round: "
                "name another file with --history"
            )

    def measured(self, history: History, X_WE: np.ndarray, time: float) -> History:
        """The history after a check on a station, which says nothing of single cameras.

        Args:
            history: so far.
            X_WE: of the poses, (6, 4, 4).
            time: of the clock in s.

        Raises:
            ValueError: if it cannot be continued so.
        """
        self.refuse(history, is_simulated=False)
        return history.appended(time, X_WE, np.full((len(self.names), 3), np.nan), [])

    def alarms(self, history: History) -> list[dict[str, Any]]:
        """What has changed: cameras by their first alarm, and the cause of deviations of the poses."""
        found: dict[str, dict[str, Any]] = {}
        for each in history.alarms:
            for alarm in each:
                found.setdefault(alarm["what"], alarm)
        drift = find_drift(self._robot, history.q, deviations(history), NOISE)
        if drift is not None:
            kind = TOOL if drift.what == TOOL else "joint zero"
            onset = float(history.time[drift.onset] - history.time[0])
            alarm = _alarm(kind, drift.what, onset, drift.size, drift.sigma)
            found[drift.what] = alarm | {"perhaps": list(drift.perhaps)}
        return list(found.values())

    def _changed(self, injected: Injected, is_new: bool) -> CameraTurn | BentArm | None:
        """What of cameras and body is changed. Raises ValueError for a marker that is not there."""
        if injected.kind == "camera":
            return CameraTurn(self.names.index(injected.what), injected.size, 1.0 if is_new else 0.0)
        if injected.kind != "marker":
            return None
        if not 1 <= int(injected.what) <= len(self._body):
            raise ValueError(f"--change: the body has markers 1 to {len(self._body)}, got {injected.what}")
        return BentArm(int(injected.what) - 1, injected.size)

    def _marker_alarms(self, check: Check, time: float) -> list[dict[str, Any]]:
        """A sphere that is gone, an arm that is bent, or a body that does not fit at all."""
        places = Places(check.X_WE, self._q)
        expected = lone_markers(self._cameras, self._rig.windows, self._body, places, self._robot)
        sigma = PIXEL_SIGMA / np.sqrt(PER_BLOCK)
        found = check_markers(self._cameras, self._body.p_E, check.X_WE, check.images, sigma, expected)
        alarms = [
            _alarm("marker", f"marker {each.marker + 1}", time, each.size, each.sigma)
            if not each.is_lost
            else _alarm("marker", f"marker {each.marker + 1} (not seen)", time, 0.0, 0.0)
            for each in found.changes
        ]
        if not alarms and found.misfit > _MISFIT:
            alarms = [_alarm("marker", "marker body (several markers)", time, 0.0, 0.0)]
        return alarms

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
    unit = "m" if kind in (TOOL, "marker") else "rad"
    return {
        "kind": kind,
        "what": what,
        "onset_s": onset,
        "size": size,
        "sigma": sigma,
        "unit": unit,
        "suggestion": _SUGGESTIONS[kind],
        "perhaps": [],
    }

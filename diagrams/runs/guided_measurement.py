"""The measurement run on a real station: a guided robot visits configurations and rests there."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from diagrams.hardware_link import EndedOnRequest, HardwareLink, StationError, never
from diagrams.runs.undisturbed import undisturbed
from diagrams.scenario.scenario import Scenario
from robots.calibration.dwells import DwellRule, Recording, mean_at_rest
from robots.description.model import NUM_JOINTS, RobotModel
from systems.link.clock import steady_time
from systems.link.protocols import PoseSource, RobotLink

Row = tuple[np.ndarray, np.ndarray, np.ndarray]  # joints (6,) rad, position (3,) m, rotation (3, 3)

_LONGEST_REST = 10.0  # s in which a camera must have shown the tool often enough
_TRIES = 3  # at one configuration, if the controller falls silent there


@dataclass(frozen=True)
class Visit:
    """A configuration to measure at."""

    number: int  # in the whole design, from one
    q: np.ndarray  # (6,) rad
    vias: np.ndarray = field(
        default_factory=lambda: np.zeros((0, NUM_JOINTS))
    )  # (k, 6) rad, on the way there


class GuidedMeasurement:
    """Visits configurations on a station that the scenario's link names."""

    def __init__(
        self, scenario: Scenario, robot: RobotModel, rule: DwellRule | None = None, speed_share: float = 0.3
    ) -> None:
        """Takes what to do.

        Args:
            scenario: of the station.
            robot: as the controller knows it.
            rule: how long it rests.
            speed_share: of the largest joint speeds, on the ways.

        Raises:
            ValueError: if the share is not between 0 and 1.
        """
        if not 0.0 < speed_share <= 1.0:
            raise ValueError(f"the share of the largest speed must be between 0 and 1, got {speed_share}")
        self._scenario, self._robot = scenario, robot
        self._rule, self._share = rule or DwellRule(), speed_share

    @undisturbed()
    def run(
        self,
        client: RobotLink,
        camera: PoseSource,
        visits: Sequence[Visit],
        keep: Callable[[Visit, Row], None],
        progress: Callable[[float], None] | None = None,
        now: Callable[[], float] = steady_time,
        is_asked_to_end: Callable[[], bool] = never,
        first_way: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
    ) -> list[int]:
        """Measures at every configuration; what is measured is kept at once, so that an end loses nothing.

        Args:
            client: to the controller.
            camera: to the camera server.
            visits: where to measure, in this order.
            keep: takes each row as soon as it is measured.
            progress: is called after each visit with the share that is done.
            now: the clock of the client's arrivals, in s.
            is_asked_to_end: whether somebody wants an end; the robot is then brought to rest.
            first_way: via points (k, 6) from where it stands to the first visit; None for a straight way.

        Returns:
            The numbers of the visits at which the camera saw too little.

        Raises:
            EndedOnRequest: if somebody wanted an end.
            StationError: if the station is not there, or stayed silent.
            ValueError: if there is no way to the first visit.
        """
        wire = HardwareLink(client, camera, self._scenario, self._robot, False, now, is_asked_to_end)
        unseen = []
        wire.connect(needs_camera=True)
        if first_way is not None and wire.last is not None:
            vias = first_way(wire.last.position, visits[0].q)
            visits = [replace(visits[0], vias=vias), *visits[1:]]
        for done, visit in enumerate(visits, 1):
            for via in visit.vias:
                wire.approach(via, self._share)
            row = self._measure_at(wire, visit, is_asked_to_end)
            if row is None:
                unseen.append(visit.number)
            else:
                keep(visit, row)
            if progress:
                progress(done / len(visits))
        wire.stop_smoothly()
        return unseen

    def _measure_at(
        self, wire: HardwareLink, visit: Visit, is_asked_to_end: Callable[[], bool]
    ) -> Row | None:
        for _ in range(_TRIES):
            wire.approach(visit.q, self._share)
            seen = self._rest(wire, visit.q, is_asked_to_end)
            if seen is not None:
                return mean_at_rest(seen, 0.0, float(seen.time[-1]), self._rule)
        raise StationError(f"the controller fell silent {_TRIES} times at configuration {visit.number}")

    def _rest(
        self, wire: HardwareLink, goal: np.ndarray, is_asked_to_end: Callable[[], bool]
    ) -> Recording | None:
        """Joints and exposures from the arrival until enough has been seen; None if it was interrupted.

        The camera's own delay does not matter: an exposure counts by when it was made, and none from before
        the arrival is looked at.
        """
        assert wire.last is not None
        wire.start_path()
        epoch, began = wire.epoch, wire.last.time
        joints: list[tuple[float, np.ndarray]] = []
        poses: list[tuple[float, np.ndarray]] = []
        needed = self._rule.settle + self._rule.mean
        while True:
            if is_asked_to_end():
                wire.stop_smoothly()
                raise EndedOnRequest
            report = wire.next_report()
            if report is None or not report.is_ready or wire.epoch != epoch or wire.was_interrupted:
                return None
            wire.send_command(goal, np.zeros(NUM_JOINTS))
            time = report.time - began
            joints.append((time, report.position))
            sample = wire.pose_at(time)
            if sample.valid and (not poses or sample.time > poses[-1][0] + 1e-6):
                poses.append((sample.time, sample.X_WE.GetAsMatrix4()))
            settled = sum(
                exposed >= self._rule.settle for exposed, _ in poses[-self._rule.fewest_exposures :]
            )
            if (time >= needed and settled >= self._rule.fewest_exposures) or time >= _LONGEST_REST:
                break
        return Recording(
            np.array([time for time, _ in joints]),
            np.array([q for _, q in joints]),
            np.array([time for time, _ in poses]),
            np.array([X for _, X in poses]).reshape(-1, 4, 4),
        )

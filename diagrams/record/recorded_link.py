"""A controller and a camera on their wires, with everything that they say written down beside it."""

from typing import Any

from diagrams.record.run_record import RunRecord
from diagrams.record.topics import JOINTS, POSE, pose_message
from systems.link.protocols import PoseSource, RobotLink, RobotReport
from systems.samples import PoseSample


class RecordedStation:
    """Both connections of a station, for whoever runs on them; times in the record are those of arrival.

    Exposures keep their own stamps, mapped to the same clock. The record begins with the first report.
    """

    def __init__(self, client: RobotLink, camera: PoseSource, record: RunRecord) -> None:
        """Takes over connections that are open, and a record that is."""
        self._record = record
        self._origin: float | None = None  # s of the clock of arrivals
        self.client: Any = _Recorded(client, self._take_report)
        self.camera: Any = _Recorded(camera, self._take_sample)

    def _take_report(self, client: RobotLink, report: RobotReport) -> None:
        if self._origin is None:
            self._origin = client.arrived
        at = client.arrived - self._origin
        joints = {"position": report.position.tolist(), "effort": client.effort.tolist()}
        self._record.write(JOINTS, at, {"stamp": report.time, **joints})

    def _take_sample(self, camera: PoseSource, sample: PoseSample) -> None:
        if self._origin is not None and sample.valid and sample.time >= self._origin:
            at = sample.time - self._origin
            self._record.write(POSE, at, pose_message(sample.X_WE.GetAsMatrix4(), at))


class _Recorded:
    """Does what the other does, and shows what it polls."""

    def __init__(self, other: Any, show: Any) -> None:
        self._other, self._show = other, show

    def __getattr__(self, name: str) -> Any:
        return getattr(self._other, name)

    def poll(self, *arguments: float) -> Any:
        found = self._other.poll(*arguments)
        if found is not None:
            self._show(self._other, found)
        return found

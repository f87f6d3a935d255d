"""What a camera at the other end of a wire saw last, and when that was on the clock of a path."""

import math

from systems.link.clock import StampClock
from systems.link.protocols import PoseSource
from systems.samples import PoseSample

_AHEAD = 0.1  # s by which a sample may seem to be exposed after the report before it
_USELESS = {  # what the counters of a camera say of frames that give no pose
    "lost_body": "it does not see the body",
    "impossible": "its frames have no rotation of the body, or other bodies than it says",
    "wrong_time": "the stamps of its frames do not fit to when they come",
    "wrong_sender": "its frames come from another address than its own",
    "garbage": "its frames cannot be read",
}


class PosesOnPath:
    """Polls a camera and puts its newest sample on the path's clock, which goes by the robot's reports.

    A sample is of one instant, whichever reports follow it: its place is told by the report before it came.
    """

    def __init__(self, camera: PoseSource | None, robot_clock: StampClock) -> None:
        """Has seen nothing.

        Args:
            camera: whose samples have times of the steady clock; None for none.
            robot_clock: from the stamps of reports to the steady clock.
        """
        self._camera, self._robot_clock = camera, robot_clock
        self.newest = PoseSample()  # its time is of the steady clock
        self._placed: PoseSample | None = None  # the same on the path's clock, once that shows a time
        self._origin = 0.0  # s of the steady clock: samples exposed before are not of this path
        self._time = self._stamp = math.nan  # s, what the path's and the robot's clock showed last

    def poll(self, now: float) -> None:
        """Takes in what has come until a steady time in s."""
        sample = self._camera.poll(now) if self._camera is not None else None
        if sample is not None:
            self.newest = sample
            self._placed = None if math.isnan(self._time) else self._on_path()

    def problem(self) -> str:
        """Why the camera shows nothing, in words."""
        if self._camera is None:
            return "there is none"
        report = self._camera.report()
        if report.last_error:
            return report.last_error
        count = report.counters.get
        why = max(_USELESS, key=lambda name: count(name, 0))
        is_idle = count("frames") == 0 and count(why, 0) == 0
        return "it sends no frames, as if it did not measure" if is_idle else _USELESS[why]

    def start_path(self, now: float) -> None:
        """What was seen before the steady time ``now`` in s belongs to another time."""
        self._origin, self._placed, self._time = now, None, math.nan

    def at(self, time: float, stamp: float) -> PoseSample:
        """The newest sample on the path's clock, which shows ``time`` where the robot's shows ``stamp``.

        Both in s.
        """
        self._time, self._stamp = time, stamp
        if self._placed is None:
            self._placed = self._on_path()
        return self._placed

    @property
    def coming(self) -> PoseSample | None:
        """What `at` will say next, if nothing new comes until then; None if that is not known."""
        return self._placed

    def _on_path(self) -> PoseSample:
        sample = self.newest
        if not sample.valid or sample.time < self._origin:
            return PoseSample()
        # The report left when its stamp says; its own arrival has jitter.
        reported = self._robot_clock.station_time(round(1e6 * self._stamp))
        if sample.time - reported > _AHEAD:  # one clock has been set, and samples until then would not count
            return PoseSample()
        return PoseSample(self._time + sample.time - reported, sample.X_WE, sample.valid, sample.residual)

"""Converts received frames to pose samples on the station's clock.

A station's loop calls `MocapReceiver.poll` between two steps of its diagram and sets what comes back into an
input port; no system of the diagram touches a socket.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from robots.configuration.quantity import positive
from systems.link.clock import ClockConfig, ClockQuality, StampClock
from systems.link.qualisys.client import MocapClient, MocapConfig
from systems.link.qualisys.conversation import State
from systems.link.qualisys.datagrams import Counters
from systems.link.qualisys.messages import Frame, PacketError
from systems.samples import PoseSample

_RESTART_GAP = 500_000  # us: a stamp this far back is no late frame any more
_EARLY = 1e-3  # s by which the jitter of the clock estimate may put an exposure after its arrival


@dataclass
class MocapReceiverConfig:
    """A camera server, its clock, and its names of world and tool; read from a scenario file."""

    server: MocapConfig = field(default_factory=MocapConfig)
    clock: ClockConfig = field(default_factory=ClockConfig)
    # Between exposure and arrival: a sample older than that is not valid
    oldest: float = positive(1.0, "s")


@dataclass
class SampleCounters:
    """Counts of accepted and rejected frames."""

    samples: int = 0  # given out, valid or not
    skipped: int = 0  # in time, but a newer one was there already
    late: int = 0  # overtaken by a newer one on the way, or come twice
    lost_body: int = 0  # the cameras did not see the body
    impossible: int = 0  # no rotation, or not the bodies that the server's parameters name
    wrong_time: int = 0  # the stamp does not fit the clock that was learned


@dataclass(frozen=True)
class MocapReport:
    """Status of the connection, for logs and tables."""

    state: State
    last_error: str  # why the last connection ended or did not come about
    version: str  # of the protocol
    wire: Counters
    samples: SampleCounters
    clock: ClockQuality

    @property
    def counters(self) -> dict[str, int]:
        """What became of packets and frames, by name."""
        return {**vars(self.wire), **vars(self.samples)}


class MocapReceiver:
    """Pose samples of one body, from a Qualisys server."""

    def __init__(
        self,
        config: MocapReceiverConfig,
        X_WM: RigidTransform | None = None,
        X_BE: RigidTransform | None = None,
    ) -> None:
        """Sets up the client; the first `poll` connects it.

        Args:
            config: the server and its clock.
            X_WM: the camera system's frame in the world; by default they are the same.
            X_BE: the tool in the frame of the tracked body; by default they are the same.

        Raises:
            ValueError: if the configuration is not possible.
        """
        if not config.oldest > 0.0:
            raise ValueError(f"camera server: oldest must be positive, got {config.oldest} s")
        self.client = MocapClient(config.server)
        self.clock = StampClock(config.clock)
        self.counters = SampleCounters()
        self._oldest = config.oldest
        self._X_WM, self._X_BE = X_WM, X_BE
        self._newest_us: int | None = None
        self._restarted_us: int | None = None  # a stamp far back, of which a second one is awaited

    def poll(self, now: float) -> PoseSample | None:
        """Takes in what has arrived; never waits.

        Args:
            now: s on the station's clock, as it is when this is called.

        Returns:
            The newest sample, if there is one that has not been given out before. It is not valid if the
            cameras have lost the body, the pose is none, or its time cannot be true.
        """
        newest: tuple[Frame, float] | None = None
        for arrival in self.client.poll():
            if not self._is_new(arrival.frame.time_us):
                self.counters.late += 1
                continue
            self.clock.observe(arrival.frame.time_us, now - arrival.age)
            self.counters.skipped += newest is not None
            newest = (arrival.frame, now - arrival.age)
        if newest is None:
            return None
        self.counters.samples += 1
        return self._sample(*newest)

    def report(self) -> MocapReport:
        """The state of the connection, all counters and how well the clocks are known, as of now."""
        client = self.client
        return MocapReport(
            client.state,
            client.last_error,
            client.version,
            replace(client.counters),
            replace(self.counters),
            self.clock.quality(),
        )

    def close(self) -> None:
        """Ends the connection."""
        self.client.close()

    def __enter__(self) -> "MocapReceiver":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _is_new(self, stamp_us: int) -> bool:
        """Whether a frame comes after all others. A measurement that begins anew is told by two frames."""
        if self._newest_us is not None and stamp_us <= self._newest_us:
            restarted, self._restarted_us = self._restarted_us, None
            if stamp_us > self._newest_us - _RESTART_GAP:
                return False
            if restarted is None or not restarted < stamp_us < restarted + _RESTART_GAP:
                self._restarted_us = stamp_us
                return False
            self.clock.restart()
        self._newest_us, self._restarted_us = stamp_us, None
        return True

    def _sample(self, frame: Frame, arrival: float) -> PoseSample:
        time = self.clock.station_time(frame.time_us)
        if not arrival - self._oldest <= time <= arrival + _EARLY:
            self.counters.wrong_time += 1
            return PoseSample(min(max(time, arrival - self._oldest), arrival))
        time = min(time, arrival)
        place = self.client.place(frame)
        try:
            X = None if place is None else frame.pose(place)
        except PacketError:
            X, place = None, None
        if place is None:
            self.counters.impossible += 1
        elif X is None:
            self.counters.lost_body += 1
        if place is None or X is None:
            return PoseSample(time)
        return PoseSample(time, self._tool(X), True, frame.residual(place))

    def _tool(self, X_MB: np.ndarray) -> RigidTransform:
        # Single precision leaves a rotation 1e-7 short of one; Drake wants it exact.
        rotation = RotationMatrix.ProjectToRotationMatrix(X_MB[:3, :3])
        X = RigidTransform(rotation, X_MB[:3, 3])
        if self._X_WM is not None:
            X = self._X_WM @ X
        return X if self._X_BE is None else X @ self._X_BE

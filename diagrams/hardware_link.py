"""Controller and camera at the other end of their wires, as one station with one clock."""

import math
from array import array
from collections.abc import Callable

import numpy as np

from diagrams.host_lateness import HostLateness, pause_before
from diagrams.scenario.scenario import Scenario
from robots.description.model import RobotModel
from systems.guard.following import Following
from systems.guard.joint_limits import JointLimits
from systems.guard.message_guard import LONGEST_OWED, MOST_BRIDGED, MessageGuard, PassedTime
from systems.link.clock import ClockConfig, StampClock, steady_time
from systems.link.poses_on_path import PosesOnPath
from systems.link.protocols import PoseSource, RobotLink, RobotReport, Starting
from systems.reference.joint_mover import smooth_motion
from systems.samples import PoseSample

_APPROACH_SHARE = 0.15  # of the largest joint speeds
_LONGEST_START = 60.0  # s, that what belongs to the station may take to begin
_SETTLE = 0.3  # s at the start point before the path's time begins
_ARRIVED = math.radians(0.02)  # how near the measured joints must come
_PATIENCE, _NEARLY = 3.0, math.radians(0.5)  # s after which it is enough to come so near
_LONGEST_APPROACH = 60.0  # s
_APPROACH_GAIN = 2.0  # 1/s, where only speeds are sent
_ELSEWHERE = math.radians(3.0)  # beyond what it was told to move, while its controller begins a session anew
_PHASE_SHARE = 0.02  # of the distance between a stamp and its tick, by which the phase follows
_LATEST, _EARLIEST = 7e-4, 2e-3  # s before the next report is due, to prepare for it
_MARGIN = 3e-4  # s, to be ready before it is due
_SOONER, _LATER = 0.1, 0.01  # of the distance, by which the beginning follows what preparations take
_CLOSE = 3e-4  # s about the time at which it is due: a frame of the camera would delay the reply
_CYCLE_TOLERANCE = 5e-3  # relative
_HEARD = ("accepted", "implausible")  # messages of the controller, each once
_HEARD_SHARE = 0.5, 1.5  # of them for each number: fewer may be lost, more cannot come
_CLOCK_STEP = 0.02  # s by which stamps may run ahead of arrivals: jitter, and a stall before
_SAME_COUNT = 1000  # messages; four seconds: whose number is further ahead is of another count
_RESTS = 25  # messages at rest that end a stop


def never() -> bool:
    """Nobody wants an end."""
    return False


class StationError(RuntimeError):
    """A station that is not there, or not the one that the scenario describes."""


class EndedOnRequest(Exception):  # noqa: N818 - as KeyboardInterrupt, no error
    """Somebody wanted an end before the path began; the robot is at rest."""


class HardwareLink:
    """Receives from controller and camera, and answers the controller."""

    def __init__(
        self,
        client: RobotLink,
        camera: PoseSource | None,
        scenario: Scenario,
        robot: RobotModel,
        is_speed_only: bool,
        now: Callable[[], float] = steady_time,
        is_asked_to_end: Callable[[], bool] = never,
        note_joints: Callable[[float, np.ndarray], None] | None = None,
    ) -> None:
        """Takes over connections that are open.

        Args:
            client: to the controller.
            camera: to the camera server, None to do without.
            scenario: which cycle and which limits the station has.
            robot: whose speeds count on the way to the start.
            is_speed_only: whether the controller is sent speeds without positions.
            now: the clock of the client's arrivals, in s.
            is_asked_to_end: whether somebody wants an end, while one waits or approaches.
            note_joints: is told the arrival of every report in s, and its joint positions (6,) in rad.
        """
        self._client, self._has_camera, self._now = client, camera is not None, now
        self._is_asked_to_end, self._note_joints = is_asked_to_end, note_joints
        self._link, self._speed, self._period = scenario.station.link, robot.speed, scenario.station.period
        self._is_speed_only = is_speed_only
        self.robot_clock = StampClock(ClockConfig())
        self.last: RobotReport | None = None
        self._unlearned: tuple[float, float] | None = None  # stamp and arrival of the last report, in s
        self.turn_around = array("f")  # s, from a report in to its reply out
        self.poses = PosesOnPath(camera, self.robot_clock)
        self._phase = 0.0  # s, of the newest stamp against its tick
        self._time = PassedTime(self._period)
        limits = JointLimits(robot, scenario.servo.guard.speed_share)
        self._guard = MessageGuard(limits, self._period, is_speed_only)
        self.following = Following(is_speed_only)
        self._stop_time = scenario.servo.guard.stop_time
        self.passed = self._period  # s from the report before the newest one to it, on the slower clock
        self.gap = 0.0  # s, the same without an upper limit
        self.clock_step = 0.0  # s by which the stamp of the newest report ran ahead of its arrival
        self.host = HostLateness(now is steady_time)
        self._ahead = _LATEST  # s, before the next report is due, at which to prepare for it
        self._heard = self._stamp = 0.0  # s of the steady clock and the controller's, of the newest message
        self._has_rested = True  # whether the robot has stood still since it was commanded, whatever was sent

    @property
    def epoch(self) -> int:
        """Grows whenever commands must start anew."""
        return self._client.epoch

    @property
    def velocity(self) -> np.ndarray:
        """Joint speeds at the newest report, (6,) in rad/s."""
        return self._client.velocity

    @property
    def utilization(self) -> float:
        """How much of its performance the robot needs at the newest report, 1 for all of it."""
        return self._client.utilization

    @property
    def effort(self) -> np.ndarray:
        """Torques at the newest report, (6,) in N m."""
        return self._client.effort

    @property
    def arrived(self) -> float:
        """Steady time at which the newest report came, in s."""
        return self._client.arrived

    def connect(self, needs_camera: bool) -> None:
        """Waits for the controller to follow commands, and for the camera. Raises StationError."""
        wait, began, has_its_cycle = self._link.connect, self._now(), False
        deadline = began + wait
        while not has_its_cycle:
            if self.wait_until_ready(deadline - self._now()) is None:
                if self._is_asked_to_end():
                    raise EndedOnRequest
                why = f"{self._client.why_not_ready()}: waited {wait:g} s on {self._client.place}"
                raise StationError(why + self.host.reason(began))
            while needs_camera and self._has_camera and not self.poses.newest.valid:
                if self._is_asked_to_end():
                    raise EndedOnRequest
                if self._now() > deadline:
                    raise StationError(f"no pose from the camera within {wait:g} s: {self.poses.problem()}")
                self.next_report()
            # A controller that was left without answers by a run before has ended, and begins again.
            has_its_cycle = self._has_its_cycle()

    def wait_for(self, other: Starting, what: str) -> None:
        """Hears the controller until something else of the station is ready.

        Args:
            other: what is to be ready.
            what: is the matter without it, for messages.

        Raises:
            EndedOnRequest: if somebody wanted an end.
            StationError: if it will never be ready, or takes too long.
        """
        deadline = self._now() + _LONGEST_START
        while not other.is_ready:
            if self._is_asked_to_end():
                raise EndedOnRequest
            if other.problem:
                raise StationError(f"{what}: {other.problem}")
            if self._now() > deadline:
                raise StationError(f"{what} within {_LONGEST_START:g} s")
            self.next_report()

    def _has_its_cycle(self) -> bool:
        """Measures it on a hundred messages; False if they do not come. StationError if it is another."""
        began = self._now()
        first = last = self.next_report()
        before, count = self._client.counters(), 0
        while count < 100 and (report := self.next_report()) is not None and last is not None:
            count, last = count + (report.seqno - last.seqno) % 2**32, report
        if first is None or last is None or count < 100:
            return False
        cycle = (last.time - first.time) / count
        # Numbers that are made of stamps say nothing of the cycle; how many messages there were does.
        now = self._client.counters()
        heard = sum(now[name] - before[name] for name in _HEARD if name in now) or count
        if not _HEARD_SHARE[0] < heard / count < _HEARD_SHARE[1]:
            cycle *= count / heard
        if abs(cycle / self._period - 1.0) > _CYCLE_TOLERANCE:
            raise StationError(
                f"the controller sends every {1e3 * cycle:.3f} ms, "
                f"station.period is {1e3 * self._period:g} ms{self.host.reason(began)}"
            )
        return True

    def wait_until_ready(self, within: float) -> RobotReport | None:
        """The first report of a robot that follows commands; None if it does not come in time."""
        deadline = self._now() + within
        while self._now() < deadline and not self._is_asked_to_end():
            report = self.next_report(wait=min(0.2, within))
            if report is not None and report.is_ready:
                if self._has_rested:
                    self._guard.forget(report.position)
                return report
        return None

    def next_report(
        self, wait: float | None = None, prepare: Callable[[], None] | None = None
    ) -> RobotReport | None:
        """The next report; None after a silence of ``wait``, by default the one that counts as a break.

        The camera is polled while the controller is silent, so that its frames do not delay the reply.

        Args:
            wait: longest silence in s.
            prepare: called shortly before the report is expected, and again if the camera sees something
                new after that. What can be known of the answer beforehand shall be worked out then; and a
                processor that has slept would need twice the time for what is new to its caches.
        """
        now = self._now()
        deadline = now + (self._link.break_after if wait is None else wait)
        expected = self._client.arrived + self._period
        prepared_for: PoseSample | None = None
        self._learn_clock()
        self._poll_camera()
        while True:
            pause = pause_before(now, expected - self._ahead, expected, deadline, prepared_for is not None)
            began, report = now, self._client.poll(pause)
            if report is not None:
                break
            now = self._now()
            self.host.note(now - began - pause, now)
            if now >= deadline:
                return None
            if not -_CLOSE < now - expected < _CLOSE:
                self._poll_camera()
            is_time = prepare is not None and now >= expected - self._ahead
            if prepare is not None and is_time and prepared_for is not self.poses.newest:
                if prepared_for is None:
                    self._client.warm_up()
                prepared_for = self.poses.newest
                prepare()
                self._note_preparation(self._now() - now)
        self.host.note(self._now() - began - pause, self._now(), is_message=True)
        self._note_time(report)
        if self._note_joints is not None:
            self._note_joints(self._client.arrived, report.position)
        self.last = report
        self._unlearned = (report.time, self._client.arrived)
        return report

    def _note_preparation(self, took: float) -> None:
        """Begins as early as it takes, in s, but one that was held up for once does not decide."""
        wanted = min(_EARLIEST, max(_LATEST, _MARGIN + took))
        self._ahead += (_SOONER if wanted > self._ahead else _LATER) * (wanted - self._ahead)

    def _note_time(self, report: RobotReport) -> None:
        """How much time has really passed since the last report, and whether a clock has been set."""
        arrived = self._client.arrived
        if self.last is not None:
            stamped, here = report.time - self._stamp, arrived - self._heard
            self.gap = max(0.0, min(stamped, here))
            # Who does not follow stands, who counts anew has been switched on, and to a command that is old
            # the robot has come, unless it was a speed.
            counted = (report.seqno - self.last.seqno) % 2**32
            self._has_rested |= not 0 < counted <= _SAME_COUNT
            self._has_rested |= self.gap > LONGEST_OWED and not self._is_speed_only
            self.clock_step = stamped - here if stamped - here > _CLOCK_STEP + self._period else 0.0
            if self.clock_step:
                self.robot_clock.restart()
        self._has_rested |= not report.is_ready
        self._heard, self._stamp = arrived, report.time
        self.passed = self._time.until(report.time, arrived)

    @property
    def was_interrupted(self) -> bool:
        """Whether the newest report came after so long a gap that the robot may stand still."""
        return self.gap > (MOST_BRIDGED + 0.5) * self._period

    @property
    def trouble(self) -> str:
        """Why the controller's newest messages are refused, or why commands had to start anew; else empty."""
        return self._client.trouble

    def ticks_since_last(self) -> int:
        """How many ticks lie between the report before and the newest one, in the time that really passed.

        The number follows the stamps, but the phase between stamps and ticks may drift: a controller whose
        cycle is a few ppm off does not skip a tick for it.
        """
        exact = self.passed / self._period + self._phase
        ticks = max(1, round(exact))
        self._phase = (1.0 - _PHASE_SHARE) * min(0.5, max(-0.5, exact - ticks))
        return ticks

    def start_path(self) -> None:
        """What the camera saw before now belongs to another time."""
        self.poses.start_path(self._now())
        self.following.restart()
        self._phase = 0.0

    def pose_at(self, time: float) -> PoseSample:
        """The newest sample of the camera on the path's clock, which shows ``time`` at the newest report."""
        assert self.last is not None
        return self.poses.at(time, self.last.time)

    def send_command(self, position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Replies to the newest report, if it may be answered, with what the limits allow; returns that."""
        position, velocity = self._guard.judged(position, velocity, self.passed)
        if self._client.send(position, velocity, self._is_speed_only):
            self.turn_around.append(self._now() - self.arrived)
            self._has_rested = False
            if self.last is not None:
                self.following.note(self.last.position, position, velocity, self.passed)
        else:
            self._guard.take_back()
        return position, velocity

    @property
    def limited_messages(self) -> int:
        """How many messages were not sent as the servo wanted them."""
        return self._guard.interventions

    def stop_smoothly(self) -> None:
        """Brings the robot to rest as long as its controller speaks, also if what it says is refused."""
        if self._guard.knows_nothing:  # the robot has not been told anything
            return
        at_rest, answered = 0, self._now()
        before = -math.inf
        while at_rest < _RESTS and self._now() - answered < self._link.break_after:
            if self._client.heard == before:
                self._client.poll(self._period)
                if self._client.heard == before:
                    continue
            before = self._client.heard
            self._heard, self._stamp = before, self._client.heard_stamp
            passed = self._time.until(self._stamp, self._now())
            if self._client.stop(*self._guard.braking(passed, self._stop_time), self._is_speed_only):
                answered = self._now()
                at_rest += self._guard.is_at_rest
            else:
                self._guard.take_back()

    def approach(self, goal: np.ndarray, speed_share: float = _APPROACH_SHARE) -> None:
        """Moves the robot smoothly to joint positions and waits until it is there.

        Args:
            goal: rad, shape (6,).
            speed_share: of the largest joint speeds.

        Raises:
            EndedOnRequest: if somebody wanted an end.
            StationError: if the controller stopped, its joints jumped, or the robot does not follow or come.
        """
        deadline = self._now() + _LONGEST_APPROACH
        epoch, start, passed = -1, goal, 0.0
        while self._now() < deadline:
            if self._is_asked_to_end():
                self.stop_smoothly()
                raise EndedOnRequest
            before, heard, report = self.last, self._heard, self.next_report()
            passed += self.passed
            if report is None or not report.is_ready:
                if (report := self.wait_until_ready(self._link.connect)) is None:
                    raise StationError(self.trouble or "the controller stopped on the way to the goal")
            elif self.epoch != epoch >= 0 and _is_elsewhere(
                before, report, speed_share * self._speed * (self._heard - heard)
            ):
                why = self.trouble  # which is over once it has stopped
                self.stop_smoothly()
                raise StationError(why)
            if self.epoch != epoch or self.was_interrupted:
                epoch, start, passed = self.epoch, report.position, 0.0
                self.following.restart()
            position, velocity, left = smooth_motion(start, goal, passed, speed_share * self._speed)
            if self._is_speed_only:
                velocity = velocity + _APPROACH_GAIN * (position - report.position)
            self.send_command(position, velocity)
            if why := self.following.problem:
                self.stop_smoothly()
                raise StationError(why)
            off = float(np.abs(report.position - goal).max())
            if left <= -_SETTLE and off < (_ARRIVED if left > -_PATIENCE else _NEARLY):
                return
        off = np.rad2deg(np.abs(self.last.position - goal).max()) if self.last else math.nan
        raise StationError(f"the robot did not reach its goal: a joint is {off:.2f} deg away")

    def _learn_clock(self) -> None:
        """Tells the clock of the last report; after the reply, because it may take a while."""
        if self._unlearned is not None:
            stamp, arrived = self._unlearned
            self.robot_clock.observe(round(1e6 * stamp), arrived)
            self._unlearned = None

    def _poll_camera(self) -> None:
        self._client.poll_aside()
        self.poses.poll(self._now())


def _is_elsewhere(before: RobotReport | None, report: RobotReport, way: np.ndarray) -> bool:
    """Whether joints are farther from the report before than the way that they may have gone, rad, (6,)."""
    return before is not None and bool((np.abs(report.position - before.position) > way + _ELSEWHERE).any())

"""A KUKA controller under RSI, as any robot's link."""

from typing import NamedTuple

import numpy as np

from robots.description.model import NUM_JOINTS
from systems.guard.way_back import way_left
from systems.link.client import LinkClient
from systems.link.guided import GuidedRobot
from systems.link.kuka.setpoint_age import SetpointAge
from systems.link.kuka.telegrams import RobotTelegram, RsiError, SensorTelegram, read_robot, write_sensor
from systems.link.session import Link

_OLD = 0.1  # s, beyond which an earlier message says nothing of the present motion
_WRAP = 2**32
_FADES = 1.0  # s, in which commands come from the set-point to what they say
_NOTHING = np.zeros(NUM_JOINTS)
_KEPT = 12  # replies that a set-point may not contain yet
_NOT_FOLLOWED = (
    "the set-point ASPos does not follow the corrections: an ASPos without them, answers that come too "
    "late, or limits of AXISCORR"
)


class RsiReport(NamedTuple):
    """What a telegram says, as `systems.link.protocols.RobotReport`; a controller that sends follows."""

    seqno: int
    time: float  # s
    position: np.ndarray  # (6,) rad
    telegram: RobotTelegram
    is_ready: bool = True


class RsiCommand(NamedTuple):
    """Where the joints shall be."""

    position: np.ndarray  # (6,) rad
    velocity: np.ndarray  # (6,) rad/s
    is_speed_only: bool = False


class RsiCodec:
    """Fits `systems.link.session.Codec`.

    A relative correction is worked out from the set-point of the telegram that it answers and the corrections
    that this set-point cannot contain yet. So replies that were lost are made up for, and never faster than
    the axes may turn.

    Commands begin, and begin anew, where the joints are measured. A controller may keep them off its
    set-point, by a following error or because the arm sags, and would make a step of that: so commands count
    from the set-point at first, and what this adds to them fades smoothly.
    """

    def __init__(
        self, largest_speed: np.ndarray, cycle: float, is_relative: bool, name: str, behind: int = 1
    ) -> None:
        """Takes what the controller is set up for.

        Args:
            largest_speed: of the joints in rad/s, (6,).
            cycle: in s.
            is_relative: whether corrections add up on the controller.
            name: its SENTYPE.
            behind: how many replies before a telegram its set-point does not contain, until that shows.
        """
        self._largest_step, self._cycle = np.asarray(largest_speed) * cycle, cycle
        self._is_relative, self._name, self._age = is_relative, name, SetpointAge(behind)
        self._sent: dict[int, np.ndarray] = {}  # (6,) rad, by the number of the telegram that was answered
        self._begins, self._began = True, -np.inf  # s, when commands began
        self._aside = np.zeros(NUM_JOINTS)  # rad, from the first command to the set-point of then

    @property
    def behind(self) -> int:
        """How many replies before a telegram its set-point does not contain, as far as that has shown."""
        return self._age.behind

    @property
    def is_followed(self) -> bool:
        """Whether set-points contain what was answered; if not, nothing is answered any more."""
        return self._age.is_followed

    def decode(self, data: bytes) -> RsiReport:
        """The report in a datagram. Raises RsiError if there is none."""
        telegram = read_robot(data)
        if not self._is_relative and telegram.correction is None:
            raise RsiError("RSI: absolute corrections need AxisCorrMon in the telegram")
        number = round(1e-3 * telegram.ipoc / self._cycle) % _WRAP
        return RsiReport(number, 1e-3 * telegram.ipoc, telegram.measured, telegram, self.is_followed)

    def encode(self, command: RsiCommand, report: RsiReport, number: int, now: float) -> bytes:
        """The correction that leads to a command. Raises RsiError if it is not finite."""
        telegram, last = report.telegram, report.seqno
        self._sent = {each: step for each, step in self._sent.items() if 0 < last - each <= _KEPT}
        self._age.note(last, telegram.setpoint, self._sent, telegram.late)
        unseen = [step for each, step in self._sent.items() if last - each <= self.behind]
        setpoint = telegram.setpoint + sum(unseen)
        if self._begins:
            self._begins, self._began = False, now
            # Commands that go on from those before begin at the set-point themselves.
            off, error = setpoint - command.position, setpoint - telegram.measured
            self._aside = np.clip(off, np.minimum(error, 0.0), np.maximum(error, 0.0))
        aside, _ = way_left(min(1.0, (now - self._began) / _FADES), _FADES, self._aside, _NOTHING)
        wanted = command.position + aside
        step = command.velocity * self._cycle if command.is_speed_only else wanted - setpoint
        step = np.minimum(np.maximum(step, -self._largest_step), self._largest_step)
        correction = step
        if not self._is_relative and telegram.correction is not None:
            correction = telegram.correction + (setpoint - telegram.setpoint) + step
        data = write_sensor(SensorTelegram(telegram.ipoc, axes=correction), self._name)
        self._sent[last] = step
        return data

    def at(self, report: RsiReport) -> RsiCommand:
        """To stay at the set-point of a report; what is commanded next begins anew."""
        self._begins = True
        return RsiCommand(report.telegram.setpoint, np.zeros(NUM_JOINTS))

    def standing(self, safe: RsiCommand, asked: RsiCommand) -> RsiCommand:
        """To hold the position of another command; where only speeds are known, no speed."""
        return RsiCommand(safe.position, np.zeros(NUM_JOINTS), safe.is_speed_only)


class KukaRobotLink(GuidedRobot[RsiReport]):
    """Fits `systems.link.protocols.RobotLink`."""

    def __init__(self, client: LinkClient[RsiReport]) -> None:
        """Takes over a socket that is open."""
        super().__init__(client)
        self._last: RsiReport | None = None
        self.velocity, self.effort = np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS)

    @property
    def ports(self) -> tuple[int, int]:
        """Where reports come in; there are no test signals."""
        return self._client.channel.address[1], 0

    @property
    def trouble(self) -> str:
        """Why the newest telegrams are refused, or that corrections are not followed; else empty."""
        return super().trouble if self._is_followed else _NOT_FOLLOWED

    def why_not_ready(self) -> str:
        """What keeps the robot from following commands."""
        if self._client.session.link is Link.WAITING:
            return self._unheard("no telegram of a controller came in")
        if not self._is_followed:
            return _NOT_FOLLOWED
        return "the controller does not run RSI"

    def poll(self, timeout: float = 0.0) -> RsiReport | None:
        """The newest report that has come, waiting for at most ``timeout`` in s."""
        report = self._client.poll(timeout)
        if report is not None:
            last, self._last = self._last, report
            passed = report.time - last.time if last else 0.0
            moved = report.position - last.position if last else np.zeros(NUM_JOINTS)
            self.velocity = moved / passed if 0.0 < passed < _OLD else np.zeros(NUM_JOINTS)
        return report

    def poll_aside(self) -> None:
        """Nothing comes beside the telegrams."""

    def send(self, position: np.ndarray, velocity: np.ndarray, is_speed_only: bool = False) -> bool:
        """Answers the newest report so that the joints come to positions (rad), or keep speeds (rad/s)."""
        return self._client.answer(RsiCommand(position, velocity, is_speed_only))

    def stop(self, position: np.ndarray, velocity: np.ndarray, is_speed_only: bool = False) -> bool:
        """Answers the newest message on the way to rest, also one that was refused."""
        return self._client.answer_stopping(RsiCommand(position, velocity, is_speed_only))

    def counters(self) -> dict[str, int]:
        """What has come and gone, by name; ``late_replies`` as the controller counts them."""
        late = 0 if self._last is None else self._last.telegram.late
        return super().counters() | {"late_replies": late}

    @property
    def _is_followed(self) -> bool:
        codec = self._client.session.codec
        return not isinstance(codec, RsiCodec) or codec.is_followed

"""The EGM client's protocol logic without sockets: which messages are valid, and when to reply."""

import math
from dataclasses import dataclass, fields, replace
from enum import Enum

import numpy as np

from systems.link.abb.messages import Command, EgmError, Mode, RobotReport, decode_report, encode_command
from systems.link.udp_channel import Address

_WRAP = 2**32  # sequence numbers begin anew after it
_LARGEST_GAP = 1000  # messages; four seconds
_LARGEST_WAIT = 60.0  # s between two messages that follow each other
_CONFIRMATIONS = 3  # further messages that a jump of count, clock or joints needs to be believed
_MANY_CONFIRMATIONS = 50  # the same for a count and a clock that both went back, as late messages have them
_POSITION_SLACK = 0.02  # rad


@dataclass
class EgmCounters:
    """Counts of datagrams; each is counted once."""

    accepted: int = 0
    superseded: int = 0  # accepted, but a newer one was already there
    duplicates: int = 0
    late: int = 0  # overtaken by a newer one
    undecodable: int = 0
    foreign: int = 0  # from another sender
    implausible: int = 0  # a jump of count, clock or joints that nothing confirmed
    missing: int = 0  # numbers that were left out
    sessions: int = 0  # counts that began
    breaks: int = 0  # silences that were longer than allowed
    stops: int = 0  # the controller stopped following commands
    replies: int = 0
    withheld: int = 0  # replies that were not finite; the last safe command went out instead

    def as_dict(self) -> dict[str, int]:
        """By name."""
        return {entry.name: getattr(self, entry.name) for entry in fields(self)}


class Link(Enum):
    """State of the connection between client and controller."""

    WAITING = "waiting"  # nothing has come yet
    STOPPED = "stopped"  # the controller reports, but does not follow commands
    READY = "ready"  # it follows commands
    BROKEN = "broken"  # it has fallen silent


class EgmSession:
    """Validates every datagram and decides on every reply. Times are on one monotonic clock, in s."""

    def __init__(
        self,
        largest_speed: np.ndarray,
        break_after: float = 0.1,
        host: str | None = None,
        period: float = 4e-3,
    ) -> None:
        """Prepares for the first message.

        Args:
            largest_speed: of the joints in rad/s, shape (6,); nothing moves twice as fast.
            break_after: silence in s after which the stream counts as broken.
            host: address of the controller, None to take whoever speaks first.
            period: shortest time between two messages in s.

        Raises:
            ValueError: if the silence is not positive.
        """
        if not break_after > 0.0:
            raise ValueError(f"EGM: break_after must be positive, got {break_after} s")
        self.counters = EgmCounters()
        self.link = Link.WAITING
        self.epoch = 0  # grows whenever commands must start anew from the measured position
        self.sender: Address | None = None
        self.last: RobotReport | None = None
        self.heard = -math.inf  # when anything last came from the controller, also what is refused
        self.trouble = ""  # why its newest messages are refused, or were until commands had to start anew
        self._speed, self._break_after, self._host = np.asarray(largest_speed).tolist(), break_after, host
        self._period = period
        self._heard = -math.inf
        self._candidate: RobotReport | None = None
        self._candidates = 0
        self._may_reply = self._may_stop = False
        self._reply_number = 0
        self._safe: Command | None = None
        self._last_data = b""
        self._last_reply: tuple[Mode, Command, int, float] | None = None

    def receive(self, data: bytes, sender: Address, now: float) -> RobotReport | None:
        """Takes a datagram; returns its report if it is the newest of this session, else None."""
        self.check(now)
        if not self._is_known(sender):
            self.counters.foreign += 1
            return None
        try:
            report = decode_report(data)
        except EgmError:
            self.counters.undecodable += 1
            return None
        self.heard, self._may_stop = now, report.is_ready
        if self.last is not None and not self._follows(report, now):
            return None
        self._accept(report, sender, now)
        self._last_data = data
        return report

    def check(self, now: float) -> None:
        """Notes a silence that has become too long."""
        if self.link in (Link.READY, Link.STOPPED) and now - self._heard > self._break_after:
            self.counters.breaks += 1
            self.link, self._may_reply = Link.BROKEN, False

    def reply(self, mode: Mode, command: Command, now: float) -> bytes | None:
        """The answer to the newest message, or None where there must be none.

        There is one answer to a message at most, and only while the robot follows commands. A command that is
        not finite never goes out; the last one that was goes instead, standing still.
        """
        if not self._may_reply or self.link is not Link.READY:
            return None
        self._may_reply = self._may_stop = False
        self._reply_number += 1
        try:
            data = encode_command(mode, command, self._reply_number, now)
            self._last_reply = mode, command, self._reply_number, now
            self._safe = command
        except EgmError:
            self.counters.withheld += 1
            if self._safe is None:
                return None
            data = encode_command(mode, _standing(self._safe), self._reply_number, now)
        self.counters.replies += 1
        return data

    def stop(self, mode: Mode, command: Command, now: float) -> bytes | None:
        """A command on the way to rest, the answer also to a message that was refused; None if none came.

        Raises:
            EgmError: if the command is not finite.
        """
        if not self._may_stop:
            return None
        self._may_reply = self._may_stop = False
        self._reply_number += 1
        self.counters.replies += 1
        return encode_command(mode, command, self._reply_number, now)

    def warm_up(self) -> None:
        """Decodes the last datagram and encodes the last reply without any effect."""
        if self._last_data and self._last_reply:
            decode_report(self._last_data)
            encode_command(*self._last_reply)

    def _is_known(self, sender: Address) -> bool:
        if self._host is not None and sender[0] != self._host:
            return False
        if self.sender is None or sender == self.sender:
            return True
        # A controller that comes back may do so from another port, never from another machine.
        return self.link is Link.BROKEN and sender[0] == self.sender[0]

    def _follows(self, report: RobotReport, now: float) -> bool:
        """Whether a report is the next one; counts what it is if not."""
        last = self.last
        assert last is not None
        ahead = (report.seqno - last.seqno + _WRAP // 2) % _WRAP - _WRAP // 2
        passed = report.time - last.time
        if ahead == 0 and passed == 0.0:
            self.counters.duplicates += 1
            return False
        longest = 2.0 * max(passed, ahead * self._period, self._period)
        moves = (report.position - last.position).tolist()
        is_plausible = all(
            abs(move) <= longest * speed + _POSITION_SLACK
            for move, speed in zip(moves, self._speed, strict=True)
        )
        if 0 < ahead <= _LARGEST_GAP and 0.0 <= passed <= _LARGEST_WAIT and is_plausible:
            self.counters.missing += ahead - 1
            self.trouble = ""
            return True
        is_late = -_LARGEST_GAP <= ahead < 0 and passed <= 0.0
        if self.link is not Link.BROKEN and not (is_late and self._candidates < _CONFIRMATIONS):
            since = self._period * ahead if 0 < ahead <= _LARGEST_GAP else 0.0
            self.trouble = _trouble(report, ahead, passed, since, max(moves, key=abs))
        if self.link is Link.BROKEN or self._is_confirmed(
            report, _MANY_CONFIRMATIONS if is_late else _CONFIRMATIONS
        ):
            self._begin()
            return True
        if is_late:
            self.counters.late += 1
        else:
            self.counters.implausible += 1
        return False

    def _is_confirmed(self, report: RobotReport, needed: int) -> bool:
        """Whether enough messages in a row agree that count, clock or joints are elsewhere now."""
        before, self._candidate = self._candidate, report
        follows = before is not None and 0 < report.seqno - before.seqno <= 10 and report.time >= before.time
        self._candidates = self._candidates + 1 if follows else 0
        return self._candidates >= needed

    def _begin(self) -> None:
        self.counters.sessions += 1
        self.epoch += 1

    def _accept(self, report: RobotReport, sender: Address, now: float) -> None:
        if self.link is Link.WAITING:
            self._begin()
        was_ready = self.link is Link.READY
        self.link = Link.READY if report.is_ready else Link.STOPPED
        if self.link is Link.READY and not was_ready:
            # What was commanded before belongs to a robot that stood elsewhere.
            self.epoch += 1
            self._safe = Command(position=report.position, velocity=np.zeros_like(report.position))
        if was_ready and self.link is Link.STOPPED:
            self.counters.stops += 1
        self.sender, self.last, self._heard = sender, report, now
        self._candidate, self._candidates = None, 0
        self._may_reply = self.link is Link.READY
        self.counters.accepted += 1


def _trouble(report: RobotReport, ahead: int, passed: float, since: float, farthest: float) -> str:
    """In words, why a message does not follow the one before.

    Args:
        report: the message.
        ahead: of the number of the one before.
        passed: s, between their stamps.
        since: s, that should lie between them.
        farthest: rad, the largest change of a joint.
    """
    if passed < 0.0:
        return f"the controller's clock stepped back by {since - passed:.3g} s"
    if passed > _LARGEST_WAIT:
        return f"the controller's clock stepped forward by {passed - since:.3g} s"
    if not 0 < ahead <= _LARGEST_GAP:
        return f"the controller's count jumped by {ahead} to {report.seqno}"
    return f"a joint jumped by {math.degrees(farthest):.3g} degrees from one message to the next"


def _standing(command: Command) -> Command:
    """A command to hold the position of another one."""
    return replace(
        command,
        velocity=None if command.velocity is None else np.zeros_like(command.velocity),
        pose_velocity=None if command.pose_velocity is None else np.zeros_like(command.pose_velocity),
    )

"""The client's side of a guided robot without sockets: which messages are valid, and when to reply."""

import math
from dataclasses import dataclass, fields
from enum import Enum
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from systems.link.protocols import RobotReport
from systems.link.udp_channel import Address

_WRAP = 2**32  # sequence numbers begin anew after it
_LARGEST_GAP = 1000  # messages; four seconds
_LARGEST_WAIT = 60.0  # s between two messages that follow each other
_CONFIRMATIONS = 3  # further messages that a jump of count, clock or joints needs to be believed
_MANY_CONFIRMATIONS = 50  # the same for a count and a clock that both went back, as late messages have them
_POSITION_SLACK = 0.02  # rad


Report = TypeVar("Report", bound=RobotReport)


class TelegramError(ValueError):
    """A datagram is none of a maker's messages, or a command cannot be written."""


class Codec(Protocol[Report]):
    """A maker's messages: reports in, commands out. What a command is, is the maker's own affair."""

    def decode(self, data: bytes) -> Report:
        """The report in a datagram. Raises TelegramError if there is none."""
        ...

    def encode(self, command: Any, report: Report, number: int, now: float) -> bytes:
        """The answer to a report, the number-th one at ``now`` in s. Raises TelegramError if not finite."""
        ...

    def at(self, report: Report) -> Any:
        """The command to stay where a report says that the robot is."""
        ...

    def standing(self, safe: Any, asked: Any) -> Any:
        """The command to hold what was commanded last, in place of one that cannot be sent."""
        ...


@dataclass
class LinkCounters:
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


class LinkSession(Generic[Report]):
    """Validates every datagram and decides on every reply. Times are on one monotonic clock, in s."""

    def __init__(
        self,
        codec: Codec[Report],
        largest_speed: np.ndarray,
        break_after: float = 0.1,
        host: str | None = None,
        period: float = 4e-3,
    ) -> None:
        """Prepares for the first message.

        Args:
            codec: of the maker.
            largest_speed: of the joints in rad/s, shape (6,); nothing moves twice as fast.
            break_after: silence in s after which the stream counts as broken.
            host: address of the controller, None to take whoever speaks first.
            period: shortest time between two messages in s.

        Raises:
            ValueError: if the silence is not positive.
        """
        if not break_after > 0.0:
            raise ValueError(f"break_after must be positive, got {break_after} s")
        self.codec, self.counters = codec, LinkCounters()
        self.link = Link.WAITING
        self.epoch = 0  # grows whenever commands must start anew from the measured position
        self.sender: Address | None = None
        self.last: Report | None = None
        self.heard = -math.inf  # when anything last came from the controller, also what is refused
        self.trouble = ""  # why its newest messages are refused, or were until commands had to start anew
        self.refused = ""  # what was the matter with the last datagram that was none of the controller's
        self._useless = 0  # messages of the controller since the last accepted that cannot be used
        self._why_useless = ""
        self._is_over = True  # whether a message has followed another since there was trouble
        self._speed, self._break_after, self._host = np.asarray(largest_speed).tolist(), break_after, host
        self._period = period
        self._heard = -math.inf
        self._candidate: Report | None = None
        self._candidates = 0
        self._may_reply = self._may_stop = False
        self._reply_number = 0
        self._safe: Any = None
        self._last_data = b""
        self._last_reply: tuple[Any, Report, int, float] | None = None
        self._newest: Report | None = None  # also one that was refused

    @property
    def heard_stamp(self) -> float:
        """What the controller's clock showed in the message that came last, also if it is refused, in s."""
        return self._newest.time if self._newest is not None else 0.0

    def receive(self, data: bytes, sender: Address, now: float) -> Report | None:
        """Takes a datagram; returns its report if it is the newest of this session, else None."""
        self.check(now)
        if not self._is_known(sender):
            self.counters.foreign += 1
            known = self.sender[0] if self.sender else self._host
            self.refused = f"it is of {sender[0]}, not of {known}"
            return None
        try:
            report = self.codec.decode(data)
        except TelegramError as error:
            self.counters.undecodable += 1
            self.refused = str(error)
            self._note_useless(self.refused)
            return None
        self.heard, self._may_stop, self._newest = now, report.is_ready, report
        if self.last is not None and not self._follows(report, now):
            return None
        self._accept(report, sender, now)
        self._last_data = data
        return report

    def forget_trouble(self) -> None:
        """Before more is read: trouble that was over by then is no longer told of."""
        if self._is_over:
            self.trouble = ""

    def check(self, now: float) -> None:
        """Notes a silence that has become too long."""
        if self.link in (Link.READY, Link.STOPPED) and now - self._heard > self._break_after:
            self.counters.breaks += 1
            self.link, self._may_reply = Link.BROKEN, False
            # One alone may have been spoiled on the way, or be there twice; so many are what it sends.
            if self._useless >= _CONFIRMATIONS and not self.trouble:
                self.trouble = f"no message of the controller can be used: {self._why_useless}"
                self._is_over = False

    def answer(self, command: Any, now: float) -> bytes | None:
        """The answer to the newest message, or None where there must be none.

        There is one answer to a message at most, and only while the robot follows commands. A command that is
        not finite never goes out; the last one that was goes instead, standing still.
        """
        report = self.last
        if not self._may_reply or self.link is not Link.READY or report is None:
            return None
        self._may_reply = self._may_stop = False
        self._reply_number += 1
        try:
            data = self.codec.encode(command, report, self._reply_number, now)
            self._last_reply = command, report, self._reply_number, now
            self._safe = command
        except TelegramError:
            self.counters.withheld += 1
            if self._safe is None:
                return None
            standing = self.codec.standing(self._safe, command)
            data = self.codec.encode(standing, report, self._reply_number, now)
        self.counters.replies += 1
        return data

    def answer_stopping(self, command: Any, now: float) -> bytes | None:
        """A command on the way to rest, the answer also to a message that was refused; None if none came.

        Raises:
            TelegramError: if the command is not finite.
        """
        if not self._may_stop or self._newest is None:
            return None
        self._may_reply = self._may_stop = False
        self._reply_number += 1
        self.counters.replies += 1
        return self.codec.encode(command, self._newest, self._reply_number, now)

    def warm_up(self) -> None:
        """Decodes the last datagram and encodes the last reply without any effect."""
        if self._last_data and self._last_reply:
            self.codec.decode(self._last_data)
            self.codec.encode(*self._last_reply)

    def _note_useless(self, why: str) -> None:
        self._useless += 1
        self._why_useless = why

    def _is_known(self, sender: Address) -> bool:
        if self._host is not None and sender[0] != self._host:
            return False
        if self.sender is None or sender == self.sender:
            return True
        # A controller that comes back may do so from another port, never from another machine.
        return self.link is Link.BROKEN and sender[0] == self.sender[0]

    def _follows(self, report: Report, now: float) -> bool:
        """Whether a report is the next one; counts what it is if not."""
        last = self.last
        assert last is not None
        ahead = (report.seqno - last.seqno + _WRAP // 2) % _WRAP - _WRAP // 2
        passed = report.time - last.time
        if ahead == 0 and passed == 0.0:
            self.counters.duplicates += 1
            self._note_useless("it repeats the same one")
            return False
        longest = 2.0 * max(passed, ahead * self._period, self._period)
        moves = (report.position - last.position).tolist()
        is_plausible = all(
            abs(move) <= longest * speed + _POSITION_SLACK
            for move, speed in zip(moves, self._speed, strict=True)
        )
        if 0 < ahead <= _LARGEST_GAP and 0.0 <= passed <= _LARGEST_WAIT and is_plausible:
            self.counters.missing += ahead - 1
            self._is_over = True
            return True
        is_late = -_LARGEST_GAP <= ahead < 0 and passed <= 0.0
        if self.link is not Link.BROKEN and not (is_late and self._candidates < _CONFIRMATIONS):
            since = self._period * ahead if 0 < ahead <= _LARGEST_GAP else 0.0
            self.trouble = _trouble(report, ahead, passed, since, max(moves, key=abs))
            self._is_over = False
        if self.link is Link.BROKEN or self._is_confirmed(
            report, _MANY_CONFIRMATIONS if is_late else _CONFIRMATIONS
        ):
            self._begin()
            # Where a robot jumped to, what was safe before is a long way off.
            self._safe = self.codec.at(report) if report.is_ready else None
            return True
        if is_late:
            self.counters.late += 1
        else:
            self.counters.implausible += 1
        return False

    def _is_confirmed(self, report: Report, needed: int) -> bool:
        """Whether enough messages in a row agree that count, clock or joints are elsewhere now."""
        before, self._candidate = self._candidate, report
        follows = before is not None and 0 < report.seqno - before.seqno <= 10 and report.time >= before.time
        self._candidates = self._candidates + 1 if follows else 0
        return self._candidates >= needed

    def _begin(self) -> None:
        self.counters.sessions += 1
        self.epoch += 1

    def _accept(self, report: Report, sender: Address, now: float) -> None:
        if self.link is Link.WAITING:
            self._begin()
        was_ready = self.link is Link.READY
        self.link = Link.READY if report.is_ready else Link.STOPPED
        if self.link is Link.READY and not was_ready:
            # What was commanded before belongs to a robot that stood elsewhere.
            self.epoch += 1
            self._safe = self.codec.at(report)
        if was_ready and self.link is Link.STOPPED:
            self.counters.stops += 1
        self.sender, self.last, self._heard = sender, report, now
        self._candidate, self._candidates = None, 0
        self._useless = 0
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
        return f"the controller's clock stepped back by {_seconds(since - passed)} s"
    if passed > _LARGEST_WAIT:
        return f"the controller's clock stepped forward by {_seconds(passed - since)} s"
    if not 0 < ahead <= _LARGEST_GAP:
        return f"the controller's count jumped by {ahead} to {report.seqno}"
    return f"a joint jumped by {math.degrees(farthest):.3g} degrees from one message to the next"


def _seconds(time: float) -> str:
    """Three digits, and never a power of ten: clocks that are set anew step by hours."""
    return f"{time:.3g}" if time < 1e3 else f"{time:.0f}"

"""The time on the path: how a path is slowed, held and resumed without being left."""

import math
from itertools import takewhile
from typing import NamedTuple, TypeVar

import numpy as np

from systems.reference.timing import PolynomialProfile

_MEMORY = 1.0  # s, for which a change that is over can still be asked for: camera samples are late
MOST_CHANGES = 96  # that are kept; one more waits until there is room
_STATE_HEAD = 4  # numbers of a state before its changes
_Share = TypeVar("_Share", float, np.ndarray)


class PathTime(NamedTuple):
    """The time on the path as a function of the station's time, s(t), from shares of the planned speed.

    A share that is asked for is reached after ``slowing`` seconds along a smooth step: the rate ds/dt has
    five continuous derivatives and lies between the shares, whatever is asked for while others are still
    being reached, for smooth steps add up. So a slowed path has the twist V s' and the acceleration
    A s'^2 + V s'', and its pose is on the path at any time.
    """

    slowing: float  # s from one share to another
    start: float = 0.0  # s of the station; before it and until the first change the share is constant
    at_start: float = 0.0  # s on the path then
    share: float = 1.0  # at the start
    changes: tuple[tuple[float, float], ...] = ()  # times in order, each with the share that is asked for

    @property
    def last_share(self) -> float:
        """The share that was asked for last."""
        return self.changes[-1][1] if self.changes else self.share

    def at(self, t: float) -> tuple[float, float, float]:
        """The time on the path in s, its rate and the rate's rate in 1/s, at a time of the station in s.

        It is asked for several times in a tick, so this is `at_times` without arrays.
        """
        s, rate, acceleration = self.at_start + self.share * (t - self.start), self.share, 0.0
        before, slowing = self.share, self.slowing
        for time, asked in self.changes:
            since, jump = t - time, asked - before
            if since <= 0.0:
                break
            if since >= slowing:
                s, rate = s + jump * (since - 0.5 * slowing), rate + jump
            else:
                step, slope, _ = PolynomialProfile.lasting(slowing).at(since)
                s, rate = s + jump * slowing * _ramp(since / slowing), rate + jump * step
                acceleration += jump * slope
            before = asked
        return s, rate, acceleration

    def at_times(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The same for an array of times of shape (n,)."""
        s = self.at_start + self.share * (t - self.start)
        rate, acceleration = np.full(len(t), self.share), np.zeros(len(t))
        if not self.changes:
            return s, rate, acceleration
        times, shares = np.array(self.changes).T
        steps = np.diff(shares, prepend=self.share)
        since = np.maximum(t[:, None] - times, 0.0)
        # After a smooth step the time on the path has what it would have with a jump in its middle.
        step, slope, _ = PolynomialProfile.lasting(self.slowing).at_times(since)
        ramp = _ramp(np.minimum(since / self.slowing, 1.0)) * self.slowing + np.maximum(
            since - self.slowing, 0.0
        )
        return s + ramp @ steps, rate + step @ steps, acceleration + slope @ steps

    def is_planned_speed(self, t: float) -> bool:
        """Whether the path is run as planned at a time of the station, if later or earlier than planned."""
        share, since = self.share, -math.inf
        for time, asked in self.changes:
            if time >= t:
                break
            share, since = asked, time
        return share == 1.0 and t - since >= self.slowing

    def changed(self, now: float, then: float, share: float) -> "PathTime":
        """With another share, from a time in s on, that is not before ``now`` nor before the last change.

        What was over long before ``now`` is forgotten. With too many changes to remember nothing is changed.
        """
        kept = self.forgetting(now - _MEMORY)
        if share == kept.last_share or len(kept.changes) >= MOST_CHANGES:
            return kept
        after = max(then, kept.changes[-1][0]) if kept.changes else then
        return kept._replace(changes=(*kept.changes, (after, share)))

    def forgetting(self, before: float) -> "PathTime":
        """The same from a time in s on; what had been reached before is no longer known."""
        over = sum(time + self.slowing <= before for time, _ in self.changes)
        if not over:
            return self
        times, shares = np.array(self.changes[:over]).T
        steps = np.diff(shares, prepend=self.share)
        start = float(times[-1]) + self.slowing
        s = self.at_start + self.share * (start - self.start) + steps @ (start - times - 0.5 * self.slowing)
        return PathTime(self.slowing, start, float(s), float(shares[-1]), self.changes[over:])

    def to_state(self) -> np.ndarray:
        """As numbers, shape (4 + 2 MOST_CHANGES,); NaN where there is no change."""
        state = np.full(_STATE_HEAD + 2 * MOST_CHANGES, np.nan)
        state[:_STATE_HEAD] = self[:_STATE_HEAD]
        if self.changes:
            state[_STATE_HEAD : _STATE_HEAD + 2 * len(self.changes)] = np.ravel(self.changes)
        return state

    @classmethod
    def from_state(cls, state: np.ndarray) -> "PathTime":
        """What `to_state` has written."""
        slowing, start, at_start, share, *rest = state.tolist()
        changes = takewhile(lambda change: not math.isnan(change[0]), zip(rest[::2], rest[1::2], strict=True))
        return cls(slowing, start, at_start, share, tuple(changes))


def _ramp(x: _Share) -> _Share:
    """The integral of the smooth step of degree 11 from 0 to x <= 1; it is 1/2 at 1."""
    x_7 = x**7
    return x_7 * (66.0 - x * (247.5 - x * (385.0 - x * (308.0 - x * (126.0 - x * 21.0)))))

"""How much later than planned the motors move: what was planned, compared with a window of encoders."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from systems.estimation.memory import History, Layout


@dataclass
class DeadTimeConfig:
    """What the search allows."""

    longest: float = 0.32  # s, by which motors may be later than believed
    earliest: float = 0.02  # s, by which they may be sooner
    window: float = 0.4  # s of encoders that are compared
    excitation: float = 1e-3  # rad, of the joint that moves most in the window: less shows nothing
    residual: float = 0.05  # share of the motion that may be left at the best shift


class Lateness(NamedTuple):
    """What a search has found."""

    lag: float  # s, by which encoders are later than the plan
    residual: float  # share of the motion that is left at this lag, 0 to 1
    residual_at_zero: float  # the same without any lag


class DeadTime:
    """The shift in time at which planned and measured positions of the joints differ least.

    Positions are compared less their means, so that offsets do not matter; the best shift is that of the
    parabola through the smallest sum of squares and its neighbours.
    """

    def __init__(self, period: float, config: DeadTimeConfig) -> None:
        """Lays out the memory: what was planned, and what encoders said.

        Raises:
            ValueError: if the window or the longest shift is not positive.
        """
        if not (config.window > 0.0 and config.longest > 0.0 and config.earliest >= 0.0):
            raise ValueError(
                "dead time: window and longest must be positive and earliest not negative, got "
                f"{config.window} s, {config.longest} s and {config.earliest} s"
            )
        self._period, self._config = period, config
        self._window = round(config.window / period)
        self._late, self._early = round(config.longest / period), round(config.earliest / period)
        # Plans are ahead of time: of the newest instants encoders will only tell.
        length = self._window + 2 * self._late + self._early + 8
        self._planned, self._measured = History(6, length), History(6, self._window + 8)
        self.layout = Layout(planned=self._planned.layout, measured=self._measured.layout)

    def plan(self, memory: SimpleNamespace, time: float, theta: np.ndarray) -> None:
        """Takes note of where the motors shall be at a time, rad, (6,)."""
        self._planned.append(memory.planned, time, theta)

    def measure(self, memory: SimpleNamespace, time: float, theta: np.ndarray) -> None:
        """Takes note of where they were."""
        self._measured.append(memory.measured, time, theta)

    def search(self, memory: SimpleNamespace) -> Lateness | None:
        """Compares; None while the window is not full, or the joints did not move enough to tell."""
        times, actual = self._measured.ordered(memory.measured)
        plan_times, plan = self._planned.ordered(memory.planned)
        n = self._window
        if len(times) < n or len(plan_times) < 2:
            return None
        times, actual = times[-n:], actual[-n:]
        end = times[-1]
        grid = end + self._period * np.arange(-(n - 1) - self._late, self._early + 1)
        even = end + self._period * np.arange(-(n - 1), 1)
        actual = np.stack([np.interp(even, times, column) for column in actual.T])
        wanted = np.stack([np.interp(grid, plan_times, column) for column in plan.T])
        actual = actual - actual.mean(axis=1, keepdims=True)
        motion = float((actual**2).sum())
        if np.sqrt((actual**2).mean(axis=1)).max() < self._config.excitation:
            return None
        shifted = np.lib.stride_tricks.sliding_window_view(wanted, n, axis=1)  # (6, shifts, n)
        shifted = shifted - shifted.mean(axis=2, keepdims=True)
        squares = ((shifted - actual[:, None]) ** 2).sum(axis=(0, 2)) / motion
        best = int(np.argmin(squares))
        fine = 0.0
        if 0 < best < len(squares) - 1:
            before, here, behind = squares[best - 1 : best + 2]
            bend = before - 2.0 * here + behind
            fine = 0.5 * (before - behind) / bend if bend > 0.0 else 0.0
        # The first window of the grid is the latest one.
        lag = (self._late - best - fine) * self._period
        return Lateness(float(lag), float(squares[best]), float(squares[self._late]))

    def found(self, lateness: Lateness | None) -> bool:
        """Whether the encoders are a shifted plan and nothing else."""
        return lateness is not None and lateness.residual < self._config.residual

"""The Cartesian reference: where the tool shall be now, and a little later."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, DependencyTicket, DiscreteValues

from systems.reference.path_time import PathTime
from systems.reference.paths import CartesianPath, ReferenceConfig, make_path
from systems.sampled_system import SampledSystem

_BLOCK = 64  # ticks that are computed at once: as cheap a tick as hundreds, and no tick waits long for it
_EPSILON = 1e-9  # s, by which rounding may miss a tick


class PathMoment(NamedTuple):
    """The path at one time. The arrays are not to be changed: others look at the same ones."""

    X_WE: np.ndarray  # the first three rows of the pose, (3, 4)
    V_WE: np.ndarray  # the spatial velocity, (6,), rad/s and m/s
    A_WE: np.ndarray  # the spatial acceleration, (6,), rad/s^2 and m/s^2


@dataclass(frozen=True)
class PathAhead:
    """The path and its timing, to be asked for any time.

    Slowing down, for whatever reason, changes the path time and never the path.
    """

    path: CartesianPath
    period: float = 4e-3  # s, of whose multiples `moment` is asked mostly
    preview: float = 0.0  # s, and of times that are so much later
    time: PathTime | None = None  # None: the path is run as planned
    _blocks: list[Callable] = field(default_factory=list, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Makes room for blocks of ticks; they are computed when they are needed first."""
        if not self._blocks:  # else they are those of the same path at another speed
            self._blocks.append(lru_cache(maxsize=16)(self._computed))

    def path_time(self, t: float) -> float:
        """The time on the path in s that belongs to a time of the station in s, as planned now."""
        return t if self.time is None else self.time.at(t)[0]

    def sample(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where the tool shall be at times of the station.

        Args:
            t: s, shape (n,).

        Returns:
            X_WE (n, 4, 4), V_WE (n, 6) in rad/s and m/s, A_WE (n, 6) in rad/s^2 and m/s^2.
        """
        if self.time is None:
            return self.path.sample(t)
        s, rate, acceleration = (row[:, None] for row in self.time.at_times(t))
        X_WE, V_WE, A_WE = self.path.sample(s[:, 0])
        return X_WE, *_slowed(V_WE, A_WE, rate, acceleration)

    def moment(self, t: float, ahead: float = 0.0) -> PathMoment:
        """Where the tool shall be at a time of the station in s; quick at ticks and a preview after them.

        Args:
            t: s.
            ahead: s, another time after ticks at which it is asked for long.
        """
        late = 0.0
        if self.time is not None:
            if not self.time.is_planned_speed(t):
                s, rate, acceleration = self.time.at(t)
                X_WE, V_WE, A_WE = self.path.sample(s)
                return PathMoment(X_WE[:3], *_slowed(V_WE, A_WE, rate, acceleration))
            late = t - self.time.at(t)[0]
        for phase in (0.0, self.preview, ahead):
            tick = round((t - phase) / self.period)
            if abs(t - phase - tick * self.period) < _EPSILON:
                # Rounded, or the sum would be another number at every tick.
                phase = phase if self.time is None else round(phase - late, 12)
                return self._blocks[0](phase, tick // _BLOCK)[tick % _BLOCK]
        X_WE, V_WE, A_WE = self.path.sample(t - late)
        return PathMoment(X_WE[:3], V_WE, A_WE)

    def _computed(self, phase: float, block: int) -> list[PathMoment]:
        ticks = np.arange(block * _BLOCK, (block + 1) * _BLOCK)
        return _moments(*self.path.sample(ticks * self.period + phase))


class Reference(SampledSystem):
    """Plays a path against the time of the context.

    Ports:
        in  ``speed_share_NAME``  1: the share of the planned speed that NAME allows, 0 to 1, for each that
                              may slow the path; the least counts, one left open is 1
        in  ``look_ahead``    1: s that the law has planned ahead, if somebody may slow the path; a change of
                              speed begins behind it. Left open it is the preview
        out ``X_WE_desired``  RigidTransform, the tool in the world
        out ``V_WE_desired``  vector 6, its spatial velocity in rad/s and m/s
        out ``A_WE_desired``  vector 6, its spatial acceleration in rad/s^2 and m/s^2
        out ``X_WE_preview``, ``V_WE_preview``, ``A_WE_preview``  the same ``preview`` seconds later
        out ``reference``     PathAhead, for any time
        out ``path_time``     vector 2: the time on the path in s and its rate

    The path is at rest before it begins and after it ends. It can be asked for at any time; multiples of
    the period are computed beforehand, many at once.
    """

    def __init__(self, config: ReferenceConfig, period: float = 4e-3, slowed_by: Sequence[str] = ()) -> None:
        """Makes the path.

        Args:
            config: which path.
            period: the tick in s at which the reference will mostly be read.
            slowed_by: who may slow it, one word each.

        Raises:
            ValueError: if the configuration describes no path, see `systems.reference.paths.make_path`, or
                one whose override holds it for ever.
        """
        super().__init__()
        self._ahead = ahead = PathAhead(make_path(config), period, config.preview)
        self.is_slowed = bool(slowed_by) or bool(config.override)
        self._at_state, self._slowed_path = b"", ahead
        asked: set[DependencyTicket] = {self.nothing_ticket()}
        if self.is_slowed:
            self._overrides = _overrides(config)
            self._shares = [self.DeclareVectorInputPort(f"speed_share_{name}", 1) for name in slowed_by]
            self._look_ahead = self.DeclareVectorInputPort("look_ahead", 1)
            begin = PathTime(config.slowing, share=self._override(0.0))
            asked = {self.discrete_state_ticket(self.DeclareDiscreteState(begin.to_state()))}
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._slow)
        # A change of the speed is a new way through the same path.
        self._ahead_port = self.DeclareAbstractOutputPort(
            "reference",
            lambda: Value[object](ahead),
            lambda context, output: output.set_value(self._path_ahead(context)),
            asked,
        )
        asked = asked | {self.time_ticket()}
        self._declare_ports("desired", 0.0, asked)
        self._declare_ports("preview", config.preview, asked)
        self.DeclareVectorOutputPort("path_time", 2, self._calc_path_time, asked)

    @property
    def path(self) -> CartesianPath:
        """The path that is played."""
        return self._ahead.path

    def _override(self, t: float) -> float:
        """The share that the configuration allows at a time in s."""
        return next((share for at, share in reversed(self._overrides) if at <= t + _EPSILON), 1.0)

    def _path_ahead(self, context: Context) -> PathAhead:
        if not self.is_slowed:
            return self._ahead
        # A function of the state alone, which seldom changes, kept to save time.
        state = context.get_discrete_state(0).value()
        if state.tobytes() != self._at_state:
            self._at_state = state.tobytes()
            self._slowed_path = replace(self._ahead, time=PathTime.from_state(state))
        return self._slowed_path

    def _slow(self, context: Context, discrete_state: DiscreteValues) -> None:
        """Takes over another share, behind what the law has planned already."""
        now = context.get_time()
        shares = [float(port.Eval(context)[0]) for port in self._shares if port.HasValue(context)]
        # A share that is not a number is nobody's leave to move.
        share = min(0.0 if math.isnan(share) else share for share in (*shares, self._override(now)))
        planned = self._ahead.preview
        if self._look_ahead.HasValue(context):
            planned = float(self._look_ahead.Eval(context)[0])
        time = self._ahead_port.Eval(context).time
        then = now + max(planned, 0.0) + self._ahead.period
        changed = time.changed(now, then, min(max(share, 0.0), 1.0))
        if changed != time:
            discrete_state.set_value(0, changed.to_state())

    def _calc_path_time(self, context: Context, output: BasicVector) -> None:
        time = self._ahead_port.Eval(context).time
        now = context.get_time()
        output.set_value((now, 1.0) if time is None else time.at(now)[:2])

    def _declare_ports(self, name: str, later: float, asked: set[DependencyTicket]) -> None:
        def moment(context: Context) -> PathMoment:
            return self._ahead_port.Eval(context).moment(context.get_time() + later)

        def calc_pose(context: Context, X_WE: AbstractValue) -> None:
            # Orthonormal by construction; checking it again would cost more than the path.
            X_WE.set_value(RigidTransform.MakeUnchecked(moment(context).X_WE))

        def calc_velocity(context: Context, V_WE: BasicVector) -> None:
            V_WE.set_value(moment(context).V_WE)

        def calc_acceleration(context: Context, A_WE: BasicVector) -> None:
            A_WE.set_value(moment(context).A_WE)

        self.DeclareAbstractOutputPort(f"X_WE_{name}", lambda: Value(RigidTransform()), calc_pose, asked)
        self.DeclareVectorOutputPort(f"V_WE_{name}", 6, calc_velocity, asked)
        self.DeclareVectorOutputPort(f"A_WE_{name}", 6, calc_acceleration, asked)


def _overrides(config: ReferenceConfig) -> list[tuple[float, float]]:
    """Times in s and shares, in order of time."""
    rows = sorted((row.at, row.share) for row in config.override)
    if rows and not rows[-1][1] > 0.0:
        raise ValueError(
            f"reference.override: the last share must be above 0, or the path is held for ever; "
            f"got {rows[-1][1]:g} from {rows[-1][0]:g} s on"
        )
    return rows


def _slowed(V_WE, A_WE, rate, acceleration) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and acceleration by the time of the station, of which the path time has these derivatives."""
    return rate * V_WE, rate**2 * A_WE + acceleration * V_WE


def _moments(X_WE: np.ndarray, V_WE: np.ndarray, A_WE: np.ndarray) -> list[PathMoment]:
    """The path at each of some times."""
    return list(map(PathMoment, X_WE[:, :3], V_WE, A_WE))

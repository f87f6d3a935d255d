"""The Cartesian reference: where the tool shall be now, and a little later."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from robots.pose import Rows
from systems.reference.paths import CartesianPath, ReferenceConfig, make_path

_BLOCK = 256  # ticks that are computed at once: far quicker than one by one
_EPSILON = 1e-9  # s, by which rounding may miss a tick


class PathMoment(NamedTuple):
    """The path at one time, in plain floats: with so few numbers Python is quicker than numpy."""

    X_WE: Rows  # the first three rows of the pose
    V_WE: Sequence[float]  # the spatial velocity, rad/s and m/s
    A_WE: Sequence[float]  # the spatial acceleration, rad/s^2 and m/s^2


@dataclass(frozen=True)
class PathAhead:
    """The path and its timing, to be asked for any time.

    Slowing down, for whatever reason, changes the path time and never the path.
    """

    path: CartesianPath
    period: float = 4e-3  # s, of whose multiples `moment` is asked mostly
    preview: float = 0.0  # s, and of times that are so much later
    _block: Callable[[float, int], list[PathMoment]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Makes room for blocks of ticks; they are computed when they are needed first."""
        object.__setattr__(self, "_block", lru_cache(maxsize=16)(self._computed))

    def path_time(self, t: float) -> float:
        """The time on the path in s that belongs to a time of the station in s, as planned now."""
        return t

    def sample(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where the tool shall be at times of the station.

        Args:
            t: s, shape (n,).

        Returns:
            X_WE (n, 4, 4), V_WE (n, 6) in rad/s and m/s, A_WE (n, 6) in rad/s^2 and m/s^2.
        """
        return self.path.sample(t)

    def moment(self, t: float, ahead: float = 0.0) -> PathMoment:
        """Where the tool shall be at a time of the station in s; quick at ticks and a preview after them.

        Args:
            t: s.
            ahead: s, another time after ticks at which it is asked for long.
        """
        for phase in (0.0, self.preview, ahead):
            tick = round((t - phase) / self.period)
            if abs(t - phase - tick * self.period) < _EPSILON:
                return self._block(phase, tick // _BLOCK)[tick % _BLOCK]
        return _moments(self.path, np.array([t]))[0]

    def _computed(self, phase: float, block: int) -> list[PathMoment]:
        ticks = np.arange(block * _BLOCK, (block + 1) * _BLOCK)
        return _moments(self.path, ticks * self.period + phase)


class Reference(LeafSystem):
    """Plays a path against the time of the context.

    Ports:
        out ``X_WE_desired``  RigidTransform, the tool in the world
        out ``V_WE_desired``  vector 6, its spatial velocity in rad/s and m/s
        out ``A_WE_desired``  vector 6, its spatial acceleration in rad/s^2 and m/s^2
        out ``X_WE_preview``, ``V_WE_preview``, ``A_WE_preview``  the same ``preview`` seconds later
        out ``reference``     PathAhead, for any time

    The path is at rest before it begins and after it ends. It can be asked for at any time; multiples of
    the period are computed beforehand, many at once.
    """

    def __init__(self, config: ReferenceConfig, period: float = 4e-3) -> None:
        """Makes the path.

        Args:
            config: which path.
            period: the tick in s at which the reference will mostly be read.

        Raises:
            ValueError: if the configuration describes no path, see `systems.reference.paths.make_path`.
        """
        super().__init__()
        ahead = PathAhead(make_path(config), period, config.preview)
        self._path = ahead.path
        self._declare_ports("desired", ahead, 0.0)
        self._declare_ports("preview", ahead, config.preview)
        self.DeclareAbstractOutputPort(
            "reference",
            lambda: Value[object](ahead),
            lambda context, output: output.set_value(ahead),
            {self.nothing_ticket()},
        )

    @property
    def path(self) -> CartesianPath:
        """The path that is played."""
        return self._path

    def _declare_ports(self, name: str, ahead: PathAhead, later: float) -> None:
        def calc_pose(context: Context, X_WE: AbstractValue) -> None:
            rows = ahead.moment(context.get_time() + later).X_WE
            # Orthonormal by construction; checking it again would cost more than the path.
            X_WE.set_value(RigidTransform.MakeUnchecked(np.array(rows)))

        def calc_velocity(context: Context, V_WE: BasicVector) -> None:
            V_WE.set_value(ahead.moment(context.get_time() + later).V_WE)

        def calc_acceleration(context: Context, A_WE: BasicVector) -> None:
            A_WE.set_value(ahead.moment(context.get_time() + later).A_WE)

        time = {self.time_ticket()}
        self.DeclareAbstractOutputPort(f"X_WE_{name}", lambda: Value(RigidTransform()), calc_pose, time)
        self.DeclareVectorOutputPort(f"V_WE_{name}", 6, calc_velocity, time)
        self.DeclareVectorOutputPort(f"A_WE_{name}", 6, calc_acceleration, time)


def _moments(path: CartesianPath, times: np.ndarray) -> list[PathMoment]:
    """The path at each of the times."""
    X_WE, V_WE, A_WE = path.sample(times)
    return list(map(PathMoment, X_WE[:, :3].tolist(), V_WE.tolist(), A_WE.tolist()))

"""The Cartesian reference: where the tool shall be now, and a little later."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from systems.reference.paths import CartesianPath, ReferenceConfig, make_path

_Moment = tuple[RigidTransform, np.ndarray, np.ndarray]  # pose, twist, acceleration


@dataclass(frozen=True)
class PathAhead:
    """The path and its timing, for a law that looks further ahead than the preview.

    Slowing down, for whatever reason, changes the path time and never the path.
    """

    path: CartesianPath

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


class Reference(LeafSystem):
    """Plays a path against the time of the context.

    Ports:
        out ``X_WE_desired``  RigidTransform, the tool in the world
        out ``V_WE_desired``  vector 6, its spatial velocity in rad/s and m/s
        out ``A_WE_desired``  vector 6, its spatial acceleration in rad/s^2 and m/s^2
        out ``X_WE_preview``, ``V_WE_preview``, ``A_WE_preview``  the same ``preview`` seconds later
        out ``reference``     PathAhead, for any time ahead

    The path is at rest before it begins and after it ends. It can be asked for at any time; multiples of
    the period are computed beforehand, all at once.
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
        self._path = make_path(config)
        self._period = period
        now = self._moments_from(0.0)
        self._declare_ports("desired", now)
        self._declare_ports("preview", self._moments_from(config.preview) if config.preview > 0.0 else now)
        ahead = PathAhead(self._path)
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

    def _moments_from(self, ahead: float) -> Callable[[float], _Moment]:
        """A function from the time to the moment of the path that is ``ahead`` of it."""
        period = self._period
        table = _moments(self._path, np.arange(math.ceil(self._path.duration / period) + 1) * period + ahead)

        def moment_at(time: float) -> _Moment:
            tick = round(time / period)
            if 0 <= tick < len(table) and abs(time - tick * period) < 1e-9:
                return table[tick]
            return _moments(self._path, np.array([time + ahead]))[0]

        return moment_at

    def _declare_ports(self, name: str, moment_at: Callable[[float], _Moment]) -> None:
        def calc_pose(context: Context, X_WE: AbstractValue) -> None:
            X_WE.set_value(moment_at(context.get_time())[0])

        def calc_velocity(context: Context, V_WE: BasicVector) -> None:
            V_WE.set_value(moment_at(context.get_time())[1])

        def calc_acceleration(context: Context, A_WE: BasicVector) -> None:
            A_WE.set_value(moment_at(context.get_time())[2])

        time = {self.time_ticket()}
        self.DeclareAbstractOutputPort(f"X_WE_{name}", lambda: Value(RigidTransform()), calc_pose, time)
        self.DeclareVectorOutputPort(f"V_WE_{name}", 6, calc_velocity, time)
        self.DeclareVectorOutputPort(f"A_WE_{name}", 6, calc_acceleration, time)


def _moments(path: CartesianPath, times: np.ndarray) -> list[_Moment]:
    """Pose, twist and acceleration at each of the times."""
    X_WE, V_WE, A_WE = path.sample(times)
    # The rotations are orthonormal by construction; checking them again would cost more than the path.
    return [(RigidTransform.MakeUnchecked(X[:3]), V, A) for X, V, A in zip(X_WE, V_WE, A_WE, strict=True)]

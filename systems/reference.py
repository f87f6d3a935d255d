"""The Cartesian reference: where the tool shall be now, and a little later."""

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, CacheEntry, Context, LeafSystem, ValueProducer

from systems.paths import CartesianPath, ReferenceConfig, make_path


class Reference(LeafSystem):
    """Plays a path against the time of the context.

    Ports:
        out ``X_WE_desired``  RigidTransform, the tool in the world
        out ``V_WE_desired``  vector 6, its spatial velocity in rad/s and m/s
        out ``A_WE_desired``  vector 6, its spatial acceleration in rad/s^2 and m/s^2
        out ``X_WE_preview``, ``V_WE_preview``, ``A_WE_preview``  the same ``preview`` seconds later

    The path is at rest before it begins and after it ends.
    """

    def __init__(self, config: ReferenceConfig) -> None:
        """Makes the path.

        Raises:
            ValueError: if the configuration describes no path, see `systems.paths.make_path`.
        """
        super().__init__()
        self._path = make_path(config)
        now = self._declare_sample("desired", 0.0)
        self._declare_ports("desired", now)
        later = self._declare_sample("preview", config.preview) if config.preview > 0.0 else now
        self._declare_ports("preview", later)

    @property
    def path(self) -> CartesianPath:
        """The path that is played."""
        return self._path

    def _declare_sample(self, name: str, ahead: float) -> CacheEntry:
        """One evaluation of the path per time, shared by three ports."""

        def calc(context: Context, sample: AbstractValue) -> None:
            X_WE, V_WE, A_WE = self._path.sample(context.get_time() + ahead)
            # The rotation is orthonormal by construction; checking it again would cost more than the path.
            sample.set_value((RigidTransform.MakeUnchecked(X_WE[:3]), V_WE, A_WE))

        empty = (RigidTransform(), np.zeros(6), np.zeros(6))
        producer = ValueProducer(allocate=lambda: AbstractValue.Make(empty), calc=calc)
        return self.DeclareCacheEntry(f"sample_{name}", producer, {self.time_ticket()})

    def _declare_ports(self, name: str, sample: CacheEntry) -> None:
        def calc_pose(context: Context, X_WE: AbstractValue) -> None:
            X_WE.set_value(sample.Eval(context)[0])

        def calc_velocity(context: Context, V_WE: BasicVector) -> None:
            V_WE.SetFromVector(sample.Eval(context)[1])

        def calc_acceleration(context: Context, A_WE: BasicVector) -> None:
            A_WE.SetFromVector(sample.Eval(context)[2])

        time = {self.time_ticket()}
        self.DeclareAbstractOutputPort(f"X_WE_{name}", lambda: Value(RigidTransform()), calc_pose, time)
        self.DeclareVectorOutputPort(f"V_WE_{name}", 6, calc_velocity, time)
        self.DeclareVectorOutputPort(f"A_WE_{name}", 6, calc_acceleration, time)

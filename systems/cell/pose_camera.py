"""A pose camera: it sees the tool at regular instants and reports it late, with noise, or not at all."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from pydrake.common import RandomDistribution
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiscreteValues, ValueProducer
from scipy.special import ndtri

from robots.configuration.quantity import quantity
from robots.description.model import RobotModel
from systems.cell.tip_pose import Tip, declare_tip
from systems.sampled_system import SampledSystem
from systems.samples import PoseSample

_WIDTH = 14  # time, valid, then the rows of the 3 x 4 pose matrix
BLOCK = 64  # exposures whose noise is drawn at once: drawing is what Drake is slow at
_PER_EXPOSURE = 7  # standard normal numbers: orientation, position, drop-out
_PER_OUTLIER = 7  # and if there are reflections: orientation, position, whether it is one
_EPSILON = 1e-9  # s, a sample that is due at a tick arrives at it in spite of rounding


@dataclass
class ExposureConfig:
    """When a camera exposes, when its samples arrive and what its clock shows; read from a scenario file."""

    period: float = quantity(4e-3, 5e-4, 1.0, "s")  # between exposures
    delay: float = quantity(4e-3, 0.0, 1.0, "s")  # transport delay: from exposure to arrival
    dropout_probability: float = quantity(0.0, 0.0, 0.999)  # of a single sample to be lost
    dropouts: list[list[float]] = field(default_factory=list)  # s, windows [start, end) without a sample
    # By which its stamps are ahead of the robot's clock
    clock_offset: float = quantity(0.0, -10.0, 10.0, "s")
    # By which its clock runs faster than the robot's
    clock_drift_ppm: float = quantity(0.0, -1e5, 1e5, "ppm")

    def stamp(self, time: float) -> float:
        """What the camera's clock shows at a time of the robot's clock, both in s."""
        return time * (1.0 + 1e-6 * self.clock_drift_ppm) + self.clock_offset

    def check(self) -> None:
        """Raises ValueError if no camera can be so."""
        if not self.period > 0.0:
            raise ValueError(f"camera: period must be positive, got {self.period} s")
        if not self.delay >= 0.0:
            raise ValueError(f"camera: delay must not be negative, got {self.delay} s")
        if not 0.0 <= self.dropout_probability < 1.0:
            raise ValueError(f"camera: dropout_probability must be in [0, 1), got {self.dropout_probability}")
        for window in self.dropouts:
            if no_window(window):
                raise ValueError(f"camera: {no_window(window)}")


def no_window(times: list[float]) -> str:
    """Why times in s are no window of a drop-out; empty if they are."""
    if len(times) == 2 and times[0] < times[1]:
        return ""
    return f"a drop-out must be [start, end] with start < end, got {times}"


@dataclass
class PoseCameraConfig(ExposureConfig):
    """A camera that sees the true pose with noise."""

    kind: ClassVar[str] = "pose"
    position_sigma: float = quantity(0.0, 0.0, 0.02, "m")  # standard deviation of one sample along each axis
    # Standard deviation of one sample about each axis
    orientation_sigma_deg: float = quantity(0.0, 0.0, 10.0, "deg")
    outlier_probability: float = quantity(0.0, 0.0, 1.0)  # of a sample to be a reflection, valid but wrong
    # Standard deviation of what it is off along each axis
    outlier_mm: float = quantity(20.0, 0.0, 1000.0, "mm")
    outlier_deg: float = quantity(2.0, 0.0, 180.0, "deg")  # and about each axis

    def camera(self, robot: RobotModel) -> "PoseCamera":
        """The camera of a station with this robot. Raises ValueError as `PoseCamera`."""
        return PoseCamera(self)


class PoseCamera(SampledSystem):
    """Measures the pose of the tool at t = 0, period, 2 period, ...

    Ports:
        in  ``X_WE``         RigidTransform, the true tool in the world
        in  ``noise``        vector 448, standard normal, drawn anew every `BLOCK` periods; 896 with outliers
        out ``pose_sample``  PoseSample, the newest one that has arrived; a lost exposure arrives as invalid
        out ``exposure``     vector 14, the last exposure before it arrives: time, validity, rows of X_WE
    and once it looks at a plant, in place of the first one:
        in  ``state``        state of the plant
        out ``X_WE``         RigidTransform, the true tool in the world

    Orientation noise is a small rotation about a random axis of the world.
    """

    def __init__(self, config: PoseCameraConfig) -> None:
        """Checks the configuration.

        Raises:
            ValueError: if a time, a standard deviation or a probability is out of its range.
        """
        super().__init__()
        _check(config)
        self._config = config
        self._rotation_sigma = float(np.deg2rad(config.orientation_sigma_deg))
        self._lost_below = ndtri(config.dropout_probability)
        self._outlier_below = ndtri(config.outlier_probability)
        self._numbers = _PER_EXPOSURE + (_PER_OUTLIER if config.outlier_probability > 0.0 else 0)
        self._X_WE = self.DeclareAbstractInputPort("X_WE", Value(RigidTransform()))
        self._noise = self.DeclareVectorInputPort(
            "noise", BLOCK * self._numbers, RandomDistribution.kGaussian
        )
        self._in_flight = int(np.floor(config.delay / config.period + _EPSILON)) + 2
        empty = np.concatenate([[-np.inf, 0.0], np.eye(4)[:3].ravel()])
        newest = self.DeclareDiscreteState(empty)
        # All that may not have arrived yet, and one that has, in a ring.
        self._ring = int(self.DeclareDiscreteState(np.tile(empty, self._in_flight)))
        self.DeclareStateOutputPort("exposure", newest)
        self.DeclareAbstractOutputPort(
            "pose_sample",
            lambda: Value(PoseSample()),
            self._calc_sample,
            {self.time_ticket(), self.xd_ticket()},
        )
        # What the numbers do to the exposures of a block is worked out for all of them at once.
        self._disturbances = self.DeclareCacheEntry(
            "disturbances", ValueProducer(Value[object], self._calc_disturbances), {self._noise.ticket()}
        )
        self.DeclarePeriodicDiscreteUpdateEvent(config.period, 0.0, self._expose)
        self._true_pose: Callable[[Context], RigidTransform] = self._X_WE.Eval

    def look_at(self, tip: Tip) -> None:
        """Works out itself where the tool of a plant is: another system for that would take longer."""
        self._true_pose = declare_tip(self, tip)

    def _calc_disturbances(self, context: Context, value) -> None:
        """Of each exposure of a block a rotation and a shift in the world, and whether it is lost."""
        noise = self._noise.Eval(context).reshape(BLOCK, self._numbers)
        turns = _small_rotations(self._rotation_sigma * noise[:, :3])
        shifts = self._config.position_sigma * noise[:, 3:6]
        if self._numbers > _PER_EXPOSURE:
            off = noise[:, _PER_EXPOSURE:] * (noise[:, -1:] < self._outlier_below)
            turns = _small_rotations(np.deg2rad(self._config.outlier_deg) * off[:, :3]) @ turns
            shifts = shifts + 1e-3 * self._config.outlier_mm * off[:, 3:6]
        value.set_value((list(turns), list(shifts), (noise[:, 6] < self._lost_below).tolist()))

    def _expose(self, context: Context, discrete_state: DiscreteValues) -> None:
        time = context.get_time()
        turns, shifts, are_lost = self._disturbances.Eval(context)
        tick = round(time / self._config.period)
        number = tick % BLOCK
        lost = are_lost[number]
        for start, end in self._config.dropouts:
            lost = lost or start <= time < end
        pose = self._true_pose(context).GetAsMatrix34()
        exposure = discrete_state.get_mutable_value(0)
        exposure[0], exposure[1] = time, not lost
        seen = exposure[2:].reshape(3, 4)
        np.dot(turns[number], pose, out=seen)
        seen[:, 3] = pose[:, 3] + shifts[number]  # which is shifted alone
        place = _WIDTH * (tick % self._in_flight)
        discrete_state.get_mutable_value(self._ring)[place : place + _WIDTH] = exposure

    def _calc_sample(self, context: Context, output) -> None:
        due = context.get_time() - self._config.delay + _EPSILON
        entry = context.get_discrete_state(0).value()
        if entry[0] > due:
            ring = context.get_discrete_state(self._ring).value().reshape(-1, _WIDTH)
            arrived = ring[ring[:, 0] <= due]
            entry = arrived[np.argmax(arrived[:, 0])]
        # Orthonormal by construction; checking it again would cost more than the rest.
        X_WE = RigidTransform.MakeUnchecked(entry[2:].reshape(3, 4))
        stamp = self._config.stamp(float(entry[0]))
        output.set_value(PoseSample(stamp, X_WE, bool(entry[1]), self._config.position_sigma))


def _small_rotations(vectors: np.ndarray) -> np.ndarray:
    """Rotations (n, 3, 3) of the quaternions along (1, v / 2): to third order those of rotation vectors v.

    A vector of zeros gives the identity exactly.
    """
    x, y, z = 0.5 * vectors.T
    s = 2.0 / (1.0 + x * x + y * y + z * z)
    rows = [
        [1.0 - s * (y * y + z * z), s * (x * y - z), s * (x * z + y)],
        [s * (x * y + z), 1.0 - s * (x * x + z * z), s * (y * z - x)],
        [s * (x * z - y), s * (y * z + x), 1.0 - s * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0).copy()


def _check(config: PoseCameraConfig) -> None:
    config.check()
    if not (config.position_sigma >= 0.0 and config.orientation_sigma_deg >= 0.0):
        raise ValueError(
            "camera: position_sigma and orientation_sigma_deg must not be negative, got "
            f"{config.position_sigma} m and {config.orientation_sigma_deg} deg"
        )
    if not 0.0 <= config.outlier_probability < 1.0:
        raise ValueError(f"camera: outlier_probability must be in [0, 1), got {config.outlier_probability}")

"""Gyros and accelerometers on bodies of a plant, read by one logger with a clock of its own."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from pydrake.common import RandomDistribution
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiscreteValues

from robots.configuration.quantity import choice, numbers, positive, quantity
from robots.pose import rotation_from_zyx
from systems.sampled_system import SampledSystem

KINDS = ("gyro", "accelerometer")
BLOCK = 64  # samples whose noise is drawn at once
_AXES = 3


@dataclass
class InertialSensorConfig:
    """One sensor with three axes: where it sits and how well it measures."""

    name: str = ""
    kind: str = choice("gyro", KINDS)
    body: str = ""  # of the plant, by its name
    position: list[float] = numbers((0.0, 0.0, 0.0), (3,), unit="m")  # in the frame of the body
    zyx_deg: list[float] = numbers((0.0, 0.0, 0.0), (3,), unit="deg")  # of its axes in that frame
    # rad/s or m/s^2: beyond it the reading stays at this limit
    range: float = positive(1000.0)
    bandwidth: float = positive(200.0, "Hz")  # where a low-pass of first order has lost 3 dB
    noise_sigma: float = quantity(0.0, 0.0)  # rad/s or m/s^2, standard deviation of one sample
    bias: list[float] = numbers((0.0, 0.0, 0.0), (3,))  # rad/s or m/s^2, on each axis

    @property
    def rotation(self) -> np.ndarray:
        """R_BS, shape (3, 3)."""
        return rotation_from_zyx(np.deg2rad(self.zyx_deg))


@dataclass
class InertialLoggerConfig:
    """Some sensors that are sampled together."""

    sensors: list[InertialSensorConfig] = field(default_factory=list)
    period: float = positive(1e-3, "s")  # between samples, by the logger's clock
    clock_offset: float = quantity(0.0, -10.0, 10.0, "s")  # by which its stamps are ahead of the robot's
    clock_drift_ppm: float = quantity(0.0, -1e4, 1e4, "ppm")  # by which its clock runs faster

    @property
    def true_period(self) -> float:
        """The time between samples by the robot's clock in s."""
        return self.period / (1.0 + 1e-6 * self.clock_drift_ppm)


class InertialSensors(SampledSystem):
    """Samples angular velocities and specific forces in the axes of the sensors.

    Ports:
        in  ``body_poses``          of all bodies, as the plant's port of that name
        in  ``body_velocities``     spatial velocities in the world, the same
        in  ``body_accelerations``  spatial accelerations in the world, the same
        in  ``noise``               vector 192 n, standard normal, drawn anew every `BLOCK` periods
        out ``sample``              vector 1 + 3 n: stamp by the logger's clock in s, then rad/s or m/s^2 of
                                    each sensor

    An accelerometer measures specific force, acceleration less gravity: at rest 9.81 m/s^2 upwards. A
    sensor's low-pass is discrete, bilinear without prewarping; bias and noise come behind it, the range last.
    A sample is taken at t = 0, ``true_period``, 2 ``true_period``, ...; before that all is zero.
    """

    def __init__(self, plant: MultibodyPlant, config: InertialLoggerConfig) -> None:
        """Takes a finalized plant.

        Raises:
            ValueError: if there is no sensor, a name is taken twice, a body is unknown, or a number is out of
                its range.
        """
        super().__init__()
        check(plant, config)
        self._config, sensors = config, config.sensors
        self._bodies = [int(plant.GetBodyByName(sensor.body).index()) for sensor in sensors]
        self._gravity = plant.gravity_field().gravity_vector()
        self._ranges = np.array([sensor.range for sensor in sensors])[:, None]
        self._sigma = np.array([sensor.noise_sigma for sensor in sensors])[:, None]
        self._bias = np.array([sensor.bias for sensor in sensors], dtype=float)
        self._rotations = [sensor.rotation for sensor in sensors]
        corner = np.array([low_pass_corner(sensor.bandwidth, config.true_period) for sensor in sensors])
        self._new, self._old = corner[:, None] / (1.0 + corner[:, None]), (1.0 - corner) / (1.0 + corner)
        self._old = self._old[:, None]
        ports = (
            ("body_poses", plant.get_body_poses_output_port()),
            ("body_velocities", plant.get_body_spatial_velocities_output_port()),
            ("body_accelerations", plant.get_body_spatial_accelerations_output_port()),
        )
        self._inputs = [self.DeclareAbstractInputPort(name, port.Allocate()) for name, port in ports]
        shape = _AXES * len(sensors)
        self._noise = self.DeclareVectorInputPort("noise", BLOCK * shape, RandomDistribution.kGaussian)
        sample = self.DeclareDiscreteState(1 + shape)
        self._filter = self.DeclareDiscreteState(2 * shape)  # last input of the low-pass, then its output
        self.DeclareStateOutputPort("sample", sample)
        self.DeclarePeriodicDiscreteUpdateEvent(config.true_period, 0.0, self._take)

    def _take(self, context: Context, discrete_state: DiscreteValues) -> None:
        time, config = context.get_time(), self._config
        tick = round(time / config.true_period)
        n = _AXES * len(config.sensors)
        reading = self._readings(context)
        if tick:
            last, output = context.get_discrete_state(self._filter).value().reshape(2, -1, _AXES)
            output = self._old * output + self._new * (reading + last)
        else:
            output = reading  # it has been at rest for long
        noise = self._noise.Eval(context)[n * (tick % BLOCK) :][:n].reshape(-1, _AXES)
        shown = np.clip(output + self._bias + self._sigma * noise, -self._ranges, self._ranges)
        stamp = time * (1.0 + 1e-6 * config.clock_drift_ppm) + config.clock_offset
        discrete_state.set_value(0, np.concatenate([[stamp], shown.ravel()]))
        filtered = np.concatenate([reading.ravel(), output.ravel()])
        discrete_state.get_mutable_value(self._filter)[:] = filtered

    def _readings(self, context: Context) -> np.ndarray:
        """What ideal sensors would show, shape (n, 3)."""
        poses, velocities, accelerations = (port.Eval(context) for port in self._inputs)
        found = np.empty((len(self._bodies), _AXES))
        for row, body, sensor, R_BS in zip(
            found, self._bodies, self._config.sensors, self._rotations, strict=True
        ):
            R_WB = poses[body].rotation().matrix()
            w_WB = velocities[body].rotational()
            if sensor.kind == "gyro":
                row[:] = R_BS.T @ (R_WB.T @ w_WB)
            else:
                p_BS_W = R_WB @ np.asarray(sensor.position)
                a_WS = accelerations[body].Shift(p_BS_W, w_WB).translational()
                row[:] = R_BS.T @ (R_WB.T @ (a_WS - self._gravity))
        return found


def low_pass_corner(bandwidth: float, period: float) -> float:
    """w T / 2 of a low-pass with a bandwidth in Hz, sampled with a period T in s."""
    return float(np.pi * bandwidth * period)


def check(plant: MultibodyPlant, config: InertialLoggerConfig) -> None:
    """Raises ValueError if no logger can be so on this plant."""
    if not config.sensors:
        raise ValueError("inertial sensors: a logger needs one or more")
    if not config.period > 0.0:
        raise ValueError(f"inertial sensors: period must be positive, got {config.period} s")
    _refuse_twice([sensor.name for sensor in config.sensors])
    for sensor in config.sensors:
        where = f"inertial sensor '{sensor.name}'"
        if sensor.kind not in KINDS:
            raise ValueError(f"{where}: kind must be one of {', '.join(KINDS)}, got '{sensor.kind}'")
        if not plant.HasBodyNamed(sensor.body):
            raise ValueError(f"{where}: the robot has no body '{sensor.body}'")
        if not (sensor.range > 0.0 and sensor.bandwidth > 0.0 and sensor.noise_sigma >= 0.0):
            raise ValueError(
                f"{where}: range and bandwidth must be positive and noise_sigma not negative, got "
                f"{sensor.range}, {sensor.bandwidth} Hz, {sensor.noise_sigma}"
            )
        for label in ("position", "zyx_deg", "bias"):
            if np.shape(getattr(sensor, label)) != (3,):
                raise ValueError(f"{where}: {label} must be three numbers, got {getattr(sensor, label)}")


def _refuse_twice(names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"inertial sensor '{name}': two of one logger have this name")

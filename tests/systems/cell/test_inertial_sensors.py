"""Gyros and accelerometers on a body that turns about the vertical: what they show, when, and how well."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint, RevoluteSpring, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from diagrams.inertial_sensors import add_inertial_sensors, seed_noise
from systems.cell.inertial_sensors import InertialLoggerConfig, InertialSensorConfig, InertialSensors

GRAVITY = 9.81  # m/s^2
SPEED, RADIUS = 3.0, 0.4  # rad/s, m
GYRO = InertialSensorConfig("gyro", "gyro", "arm")
ACCELEROMETER = InertialSensorConfig("accelerometer", "accelerometer", "arm", [RADIUS, 0.0, 0.0])


def turntable(stiffness: float = 0.0) -> MultibodyPlant:
    """A body on a vertical axis, 1 kg m^2 about it, with a spring if wanted."""
    plant = MultibodyPlant(0.0)
    arm = plant.AddRigidBody("arm", SpatialInertia(1.0, np.zeros(3), UnitInertia(1.0, 1.0, 1.0)))
    joint = plant.AddJoint(
        RevoluteJoint("axis", plant.world_frame(), arm.body_frame(), np.array([0.0, 0.0, 1.0]))
    )
    if stiffness:
        plant.AddForceElement(RevoluteSpring(joint, 0.0, stiffness))
    plant.Finalize()
    return plant


def samples(
    config: InertialLoggerConfig,
    speed: float = SPEED,
    seed: int = 0,
    until: float = 0.3,
    stiffness: float = 0.0,
) -> np.ndarray:
    """Stamps and readings of a turntable that starts at some speed, shape (n, 1 + 3 sensors)."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(turntable(stiffness))
    sources, ports = add_inertial_sensors(builder, plant, [config])
    log = LogVectorOutput(ports["inertial_sample_1"], builder, config.true_period)
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    plant.SetVelocities(plant.GetMyMutableContextFromRoot(context), [speed])
    seed_noise(sources, context, seed)
    simulator.get_mutable_integrator().set_fixed_step_mode(True)
    simulator.get_mutable_integrator().set_maximum_step_size(1e-4)
    simulator.AdvanceTo(until)
    return log.FindLog(context).data().T[1:]


def test_a_turntable_shows_its_rate_and_what_it_pulls_outwards_and_down():
    shown = samples(InertialLoggerConfig([GYRO, ACCELEROMETER]))
    np.testing.assert_allclose(shown[:, 1:4], np.tile([0.0, 0.0, SPEED], (len(shown), 1)), atol=1e-9)
    pulled = [-RADIUS * SPEED**2, 0.0, GRAVITY]
    np.testing.assert_allclose(shown[:, 4:], np.tile(pulled, (len(shown), 1)), atol=1e-6)


def test_axes_are_those_of_the_sensor():
    """Turned by 90 degrees about y, the sensor's x axis points down and its z axis outwards."""
    turned = replace(ACCELEROMETER, zyx_deg=[0.0, 90.0, 0.0])
    shown = samples(InertialLoggerConfig([turned]))[0, 1:]
    np.testing.assert_allclose(shown, [-GRAVITY, 0.0, -RADIUS * SPEED**2], atol=1e-6)


def test_stamps_are_those_of_the_loggers_own_clock():
    config = InertialLoggerConfig([GYRO], period=2e-3, clock_offset=0.5, clock_drift_ppm=5000.0)
    stamps = samples(config)[:, 0]
    np.testing.assert_allclose(np.diff(stamps), 2e-3, rtol=1e-9)
    assert stamps[0] == pytest.approx(0.5)
    assert len(stamps) == int(0.3 / (2e-3 / 1.005))  # in 0.3 s of the robot's clock


def test_a_vibration_at_the_bandwidth_loses_three_decibels():
    """The spring makes the turntable swing at 20 Hz, far below the sampling rate."""
    swing = 2.0 * np.pi * 20.0
    wide, narrow = (
        samples(
            InertialLoggerConfig([replace(GYRO, bandwidth=band)]), until=0.5, stiffness=swing**2, speed=1.0
        )[200:, 3]
        for band in (2000.0, 20.0)
    )
    assert np.ptp(narrow) / np.ptp(wide) == pytest.approx(np.sqrt(0.5), rel=0.02)


def test_range_bias_and_noise():
    limited = samples(InertialLoggerConfig([replace(GYRO, range=2.0)]))[:, 3]
    np.testing.assert_allclose(limited, 2.0)
    config = InertialLoggerConfig([replace(GYRO, noise_sigma=0.05, bias=[0.1, -0.2, 0.0])])
    once, again, other = (samples(config, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(once, again)
    assert not np.array_equal(once, other)
    np.testing.assert_allclose(np.std(once[:, 1:], axis=0), 0.05, rtol=0.15)
    np.testing.assert_allclose(np.mean(once[:, 1:], axis=0), [0.1, -0.2, SPEED], atol=0.012)


@pytest.mark.parametrize(
    ("sensors", "message"),
    [
        ([], "needs one or more"),
        ([GYRO, GYRO], "'gyro': two of one logger"),
        ([replace(GYRO, body="leg")], "no body 'leg'"),
        ([replace(GYRO, kind="compass")], "kind must be one of gyro, accelerometer, got 'compass'"),
        ([replace(GYRO, bandwidth=0.0)], "bandwidth must be positive"),
        ([replace(GYRO, position=[0.0, 1.0])], "position must be three numbers"),
    ],
)
def test_refuses_what_no_logger_can_be(sensors, message):
    with pytest.raises(ValueError, match=message):
        InertialSensors(turntable(), InertialLoggerConfig(sensors))

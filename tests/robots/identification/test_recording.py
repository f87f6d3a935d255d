"""Recordings are brought to one time, and refused where nothing can be learnt from them."""

from dataclasses import replace

import numpy as np
import pytest

from robots.identification.motion import SensorPlace
from robots.identification.recording import (
    RecordedCase,
    RecordingError,
    check_axes,
    check_excitation,
    check_gravity,
    check_range,
    check_sizes,
    check_speeds,
    lag_of,
)

PERIOD = 1e-3  # s
GYRO = SensorPlace("hand", "gyro", "link_5", np.zeros(3), np.eye(3), 200.0, 2e-3)


def motion(t: np.ndarray) -> np.ndarray:
    """What a gyro shows of a short motion, three axes that differ, (n, 3)."""
    begun = np.clip((t - 0.2) / 0.3, 0.0, 1.0)
    pulse = np.square(np.sin(np.pi * begun))
    return np.stack([pulse, 0.5 * pulse * np.sin(12.0 * begun), -0.8 * np.square(pulse) * begun], axis=1)


def recorded(offset: float = 0.0, noise: float = 2e-3) -> RecordedCase:
    """A second of it, stamped by a clock that is ahead by an offset in s."""
    time = PERIOD * np.arange(1000)
    rng = np.random.default_rng(5)
    shown = motion(time + 0.3e-3) + noise * rng.normal(size=(1000, 3))
    rate = np.zeros((1000, 6))
    rate[:, 0] = motion(time)[:, 0]
    theta = PERIOD * np.cumsum(rate, axis=0)
    return RecordedCase("1", time, theta, rate, rate, time + 0.3e-3 + offset, shown[:, None])


MODELLED = motion(PERIOD * np.arange(1000))[:, None]


@pytest.mark.parametrize("offset", [0.0, 0.0417, -0.12])
def test_the_stamps_of_another_clock_are_brought_to_the_robots_time(offset: float):
    case = recorded(offset)
    lag = lag_of(case, MODELLED, [GYRO], 0.0)
    assert lag == pytest.approx(offset, abs=0.1 * PERIOD)
    aligned = case.at_lag(lag).readings
    known = np.isfinite(aligned).all((1, 2))
    assert known.mean() > 0.8
    np.testing.assert_allclose(aligned[known], MODELLED[known], atol=6.0 * GYRO.sigma)


def test_clocks_off_by_more_than_the_window_are_refused():
    with pytest.raises(RecordingError, match=r"case 1: the clocks of robot and sensors: no lag within"):
        lag_of(recorded(0.4), MODELLED, [GYRO], 0.0)
    with pytest.raises(RecordingError, match=r"less than half of the time in common: 0 to 0.999 s and 50"):
        lag_of(recorded(50.0), MODELLED, [GYRO], 0.0)


def test_swapped_axes_of_a_gyro_are_named():
    case = recorded().at_lag(0.0)
    check_axes([case], [MODELLED], [GYRO])
    swapped = replace(case, readings=case.readings[..., [2, 1, 0]])
    with pytest.raises(RecordingError, match=r"gyro 'hand': its axes are swapped .* should be x is on z"):
        check_axes([swapped], [MODELLED], [GYRO])
    turned = replace(case, readings=-case.readings)
    with pytest.raises(RecordingError, match=r"should be x is on -x"):
        check_axes([turned], [MODELLED], [GYRO])


def test_a_recording_at_rest_says_what_it_cannot_show():
    case = recorded().at_lag(0.0)
    check_excitation([case], [MODELLED], [GYRO])
    still = replace(case, rate=0.0 * case.rate)
    with pytest.raises(RecordingError, match=r"no excitation.*gears, bearings and beams cannot be seen"):
        check_excitation([still], [0.0 * MODELLED], [GYRO])


@pytest.mark.parametrize(("factor", "said"), [(np.rad2deg(1.0), "57.3"), (np.deg2rad(1.0), "0.0175")])
def test_a_sensor_in_another_unit_is_named(factor: float, said: str):
    case = recorded(noise=0.0).at_lag(0.0)
    check_sizes([case], [MODELLED], [GYRO])
    scaled = replace(case, readings=factor * case.readings)
    with pytest.raises(RecordingError, match=rf"gyro 'hand': it shows {said} times .* brings them to rad/s"):
        check_sizes([scaled], [MODELLED], [GYRO])


def test_gyros_that_are_all_off_alike_tell_of_the_positions():
    case, pair = recorded(noise=0.0).at_lag(0.0), [GYRO, replace(GYRO, name="arm")]
    many = replace(case, readings=np.rad2deg(np.repeat(case.readings, 2, axis=1)))
    with pytest.raises(RecordingError, match=r"all gyros show some 57 times .* than angle_factor says"):
        check_sizes([many], [np.repeat(MODELLED, 2, axis=1)], pair)


def test_a_sensor_that_shows_nothing_is_named():
    case = recorded().at_lag(0.0)
    with pytest.raises(RecordingError, match="gyro 'hand': it shows nothing but one value"):
        check_sizes([replace(case, readings=0.0 * case.readings + 0.1)], [MODELLED], [GYRO])


def test_an_accelerometer_in_g_is_named_and_one_of_changes_alone_is_not():
    """Ringing hides in which unit what it shows beyond its mean is; gravity does not."""
    sensor = replace(GYRO, kind="accelerometer", sigma=0.05)
    up = np.array([0.0, 0.6, 0.8]) * 9.81
    case = recorded().at_lag(0.0)
    ringing = 9.0 * np.sin(300.0 * case.times)[:, None, None] * np.ones(3)
    modelled = MODELLED + up
    measured = replace(case, readings=case.readings + up + ringing)
    check_gravity([measured], [modelled], [sensor])
    check_gravity([replace(measured, readings=measured.readings - up + 0.1)], [modelled], [sensor])
    with pytest.raises(RecordingError, match=r"accelerometer 'hand': it shows 0.10\d times what gravity"):
        check_gravity([replace(measured, readings=measured.readings / 9.81)], [modelled], [sensor])
    check_gravity([replace(measured, readings=np.nan * measured.readings)], [modelled], [sensor])


@pytest.mark.parametrize(("factor", "said"), [(np.rad2deg(1.0), "57.3"), (-1.0, "-1"), (1e3, "1e.03")])
def test_speeds_that_are_not_those_of_the_positions_are_named(factor: float, said: str):
    case = recorded()
    check_speeds([case])
    with pytest.raises(RecordingError, match=rf"case 1: the speed of joint 1 is {said} times what its posit"):
        check_speeds([case, replace(case, rate=factor * case.rate)])


def test_positions_in_degrees_are_named():
    case, limits = recorded(), np.full(6, 2.0)
    check_range([case], -limits, limits)
    degrees = replace(case, theta=np.rad2deg(case.theta + 1.0))
    with pytest.raises(
        RecordingError, match=r"case 1: joint 1 is at .* is -114.592 to 114.592; .* angle_factor"
    ):
        check_range([case, degrees], -limits, limits)

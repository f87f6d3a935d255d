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
    check_range,
    check_sizes,
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


def test_positions_in_degrees_are_named():
    case, limits = recorded(), np.full(6, 2.0)
    check_range([case], -limits, limits)
    degrees = replace(case, theta=np.rad2deg(case.theta + 1.0))
    with pytest.raises(
        RecordingError, match=r"case 1: joint 1 is at .* is -114.592 to 114.592; .* angle_factor"
    ):
        check_range([case, degrees], -limits, limits)

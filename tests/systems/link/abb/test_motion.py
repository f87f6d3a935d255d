"""How a controller plans under EGM: what is followed without delay, what is filtered, limited and stopped."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from systems.link.abb.motion import EgmMotion, EgmMotionConfig

PERIOD = 4.032e-3  # s
NOTHING = np.full(6, np.nan)
SHARP = EgmMotionConfig(bandwidth=0.0, ramp_in=0.0)


def planned(config: EgmMotionConfig, references, speeds, start=0.0) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (n, 6) that are planned for references and speeds, tick by tick."""
    motion = EgmMotion(config, PERIOD)
    context = motion.CreateDefaultContext()
    motion.set_at_rest(context, np.full(6, start))
    rows = []
    for reference, speed in zip(references, speeds, strict=True):
        motion.GetInputPort("position_command").FixValue(context, np.broadcast_to(reference, 6))
        motion.GetInputPort("velocity_command").FixValue(context, np.broadcast_to(speed, 6))
        ports = (motion.GetOutputPort(f"{name}_command") for name in ("position", "velocity"))
        rows.append([port.Eval(context).copy() for port in ports])
        context.SetDiscreteState(motion.EvalUniquePeriodicDiscreteUpdate(context))
        assert np.array_equal(motion.planned_position(context), rows[-1][0])
    positions, velocities = np.array(rows).swapaxes(0, 1)
    return positions, velocities


def test_a_uniform_motion_is_followed_without_delay():
    """Once the start has died away the plan is on the reference of the same tick."""
    time = PERIOD * np.arange(400)
    positions, velocities = planned(EgmMotionConfig(), 0.3 * time, np.full(400, 0.3))
    np.testing.assert_allclose(positions[-1], 0.3 * time[-1], atol=1e-10)
    np.testing.assert_allclose(velocities[-1], 0.3, atol=1e-9)


def test_a_step_of_the_reference_is_approached_as_the_gain_says():
    """Speed = gain times distance, averaged over a tick: the factor a tick is known in closed form."""
    gain, n = 10.0, 60
    positions, _ = planned(EgmMotionConfig(gain=gain, bandwidth=0.0, ramp_in=0.0), [0.01] * n, [0.0] * n)
    kT = gain * PERIOD
    # With x = (distance, T v): v' = gain (d - T v), d' = d - (T v + T v') / 2.
    step = np.array([[1.0 - kT / 2.0, -0.5 + kT / 2.0], [kT, -kT]])
    x, expected = np.array([0.01, 0.0]), []
    for _ in range(n):
        x = step @ x
        expected.append(0.01 - x[0])
    np.testing.assert_allclose(positions[:, 0], expected, atol=1e-15)


def test_the_low_pass_has_its_bandwidth():
    """A step of the speed alone (gain 0) answers as 1 - exp(-2 pi f t)."""
    config = EgmMotionConfig(gain=0.0, bandwidth=5.0, ramp_in=0.0)
    _, velocities = planned(config, [NOTHING] * 50, [0.2] * 50)
    expected = 0.2 * (1.0 - np.exp(-2.0 * math.pi * 5.0 * PERIOD * np.arange(1, 51)))
    np.testing.assert_allclose(velocities[:, 0], expected, atol=1e-12)


def test_with_speeds_alone_the_plan_is_their_integral():
    speeds = 0.2 * np.sin(np.linspace(0.0, 2.0 * np.pi, 500))
    positions, velocities = planned(SHARP, [NOTHING] * 500, speeds)
    np.testing.assert_allclose(velocities[:, 0], speeds, atol=1e-15)
    np.testing.assert_allclose(positions[-1], 0.0, atol=1e-12)  # a full period of the sine


def test_egm_takes_over_within_the_ramp():
    config = EgmMotionConfig(gain=0.0, bandwidth=0.0, ramp_in=10 * PERIOD)
    _, velocities = planned(config, [NOTHING] * 20, [0.1] * 20)
    np.testing.assert_allclose(velocities[:10, 0], 0.01 * np.arange(1, 11))
    np.testing.assert_allclose(velocities[10:, 0], 0.1)


@given(
    references=st.lists(st.floats(-3.0, 3.0), min_size=5, max_size=60),
    deviation=st.floats(1.0, 300.0),
)
def test_no_joint_is_faster_than_egm_may_be_and_position_is_the_integral_of_velocity(references, deviation):
    config = EgmMotionConfig(largest_speed_deviation_deg_s=deviation, ramp_in=0.0)
    positions, velocities = planned(config, references, [0.0] * len(references))
    assert np.abs(velocities).max() <= math.radians(deviation) * (1.0 + 1e-12)
    means = 0.5 * (velocities[1:] + velocities[:-1])
    np.testing.assert_allclose(np.diff(positions, axis=0), PERIOD * means, atol=1e-12)


def test_when_commands_end_the_robot_stops_evenly_within_the_stop_time():
    config = EgmMotionConfig(stop_time=0.2)
    n = 170
    speeds = [0.5] * 100 + [np.nan] * (n - 100)
    positions, velocities = planned(config, [NOTHING] * n, speeds)
    stopping = velocities[99:, 0]
    assert np.flatnonzero(stopping == 0.0)[0] * PERIOD <= 0.2 + PERIOD
    falls = np.diff(stopping[: np.flatnonzero(stopping == 0.0)[0]])
    np.testing.assert_allclose(falls, -0.5 * PERIOD / 0.2, rtol=1e-6)
    np.testing.assert_array_equal(positions[-1], positions[-2])


@pytest.mark.parametrize("change", [{"gain": 21.0}, {"gain": -1.0}, {"bandwidth": -1.0}, {"stop_time": -0.1}])
def test_settings_that_no_controller_has_are_refused(change: dict):
    with pytest.raises(ValueError, match=f"EGM: {next(iter(change))} must"):
        EgmMotion(EgmMotionConfig(**change), PERIOD)

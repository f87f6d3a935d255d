"""Telegrams of RSI say what was put into them, and nothing else is taken for one."""

import contextlib
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from systems.link.kuka.telegrams import (
    RobotTelegram,
    RsiError,
    SensorTelegram,
    read_robot,
    read_sensor,
    write_robot,
    write_sensor,
)

six = st.lists(st.floats(-6.0, 6.0), min_size=6, max_size=6).map(np.array)
ROBOT = RobotTelegram(4_208_163_634, np.zeros(6), np.zeros(6), np.zeros(6), 0, np.zeros(6))


@given(ipoc=st.integers(0, 10**12), axes=six, pose=six)
def test_what_a_sensor_writes_is_read_again(ipoc, axes, pose):
    telegram = read_sensor(write_sensor(SensorTelegram(ipoc, axes, pose)))
    assert telegram.ipoc == ipoc
    assert telegram.axes is not None
    assert telegram.pose is not None
    np.testing.assert_allclose(telegram.axes, axes, atol=1e-11)
    np.testing.assert_allclose(telegram.pose, pose, atol=1e-11)


@given(measured=six, setpoint=six, pose=six, late=st.integers(0, 1000))
def test_what_a_controller_writes_is_read_again(measured, setpoint, pose, late):
    telegram = read_robot(write_robot(RobotTelegram(7, measured, setpoint, pose, late)))
    for name, value in (("measured", measured), ("setpoint", setpoint), ("pose", pose)):
        np.testing.assert_allclose(getattr(telegram, name), value, atol=1e-11)
    assert (telegram.late, telegram.correction) == (late, None)


@pytest.mark.slow
@given(st.binary(max_size=400))
@settings(max_examples=300)
def test_any_bytes_are_a_telegram_or_refused(data):
    for read in (read_robot, read_sensor):
        with contextlib.suppress(RsiError):
            read(data)


@given(data=st.data())
@settings(max_examples=300)
def test_a_changed_telegram_is_read_with_finite_numbers_or_refused(data):
    message = bytearray(write_robot(ROBOT))
    for _ in range(data.draw(st.integers(1, 4))):
        message[data.draw(st.integers(0, len(message) - 1))] = data.draw(st.integers(0, 255))
    try:
        telegram = read_robot(bytes(message))
    except RsiError:
        return
    assert np.isfinite([telegram.measured, telegram.setpoint, telegram.pose]).all()


@pytest.mark.real_time
def test_entities_are_not_expanded():
    laughs = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 10))
    data = f'<!DOCTYPE Sen [<!ENTITY l0 "ha">{laughs}]><Sen><IPOC>&l9;</IPOC></Sen>'.encode()
    start = time.process_time()
    with pytest.raises(RsiError):
        read_sensor(data)
    assert time.process_time() - start < 0.005


@pytest.mark.parametrize("number", ["nan", "inf", "1e300", "", "1,5", "9" * 5000])
def test_what_is_no_number_of_a_robot_is_refused(number):
    data = write_sensor(SensorTelegram(1, axes=np.zeros(6))).replace(
        b'A3="0.000000000"', f'A3="{number}"'.encode()
    )
    with pytest.raises(RsiError):
        read_sensor(data)


def test_a_correction_that_is_not_finite_is_not_written():
    with pytest.raises(RsiError):
        write_sensor(SensorTelegram(1, axes=np.full(6, np.nan)))

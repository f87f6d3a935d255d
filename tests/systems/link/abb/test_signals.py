# A None where there should be something fails a test as it should.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportAttributeAccessIssue=false
"""Test signals: any layout comes out as it went in, anything else is refused."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from systems.link.abb.signal_client import SignalClient
from systems.link.abb.signals import ControllerSignals, SignalCodec, SignalError, SignalLayout
from systems.link.udp_channel import UdpChannel

numbers = st.lists(st.floats(-100.0, 100.0), min_size=6, max_size=6).map(np.array)


@given(
    velocity=numbers,
    torque=numbers,
    fields=st.permutations(["time", "velocity", "torque"]),
    number=st.sampled_from(["float32", "float64", "text"]),
    order=st.sampled_from(["little", "big"]),
)
def test_every_layout_can_be_read_back(velocity, torque, fields, number, order):
    codec = SignalCodec(SignalLayout(fields=fields, number=number, byte_order=order))
    found = codec.decode(codec.encode(ControllerSignals(12.345, velocity, torque)))
    digits = {"float32": 1e-6, "float64": 1e-12, "text": 1e-8}[number]
    assert found.time == pytest.approx(12.345, rel=digits)
    np.testing.assert_allclose(found.velocity, velocity, rtol=digits, atol=1e-30)
    np.testing.assert_allclose(found.torque, torque, rtol=digits, atol=1e-30)


def test_the_default_is_milliseconds_radians_a_second_and_newton_metres():
    data = struct.pack("<13f", 1500.0, *range(6), *range(10, 16))
    found = SignalCodec(SignalLayout()).decode(data)
    assert found.time == pytest.approx(1.5)
    np.testing.assert_allclose(found.velocity, range(6))
    np.testing.assert_allclose(found.torque, range(10, 16))


def test_torque_from_outside_and_inputs_are_read_where_a_program_sends_them():
    """Signals 4003, 102 and 103 of Probst (2024), table B.3."""
    layout = SignalLayout(fields=["time", "external_torque", "inputs"], number="text", torque_unit=1e-3)
    found = SignalCodec(layout).decode(b"2000;0;1500;0;0;0;-250;1;0")
    np.testing.assert_allclose(found.external_torque, [0.0, 1.5, 0.0, 0.0, 0.0, -0.25])
    np.testing.assert_array_equal(found.inputs, [1, 0])
    assert found.torque is None


def test_a_text_with_degrees_is_taken_to_radians():
    layout = SignalLayout(fields=["velocity"], number="text", separator=",", velocity_unit_deg_s=1.0)
    found = SignalCodec(layout).decode(b"180,0,0,0,0,-90")
    np.testing.assert_allclose(found.velocity, [np.pi, 0.0, 0.0, 0.0, 0.0, -np.pi / 2.0])
    assert np.isnan(found.time)


@pytest.mark.parametrize("number", ["float32", "text"])
@given(data=st.binary(max_size=120))
def test_what_does_not_fit_is_refused_with_one_kind_of_error(number: str, data: bytes):
    codec = SignalCodec(SignalLayout(number=number))
    try:
        found = codec.decode(data)
    except SignalError:
        return
    assert np.isfinite(found.velocity).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fields": ["time", "force"]}, "fields must be some of"),
        ({"fields": ["time", "time"]}, "each once"),
        ({"fields": []}, "fields must be"),
        ({"number": "int"}, "number must be float32, float64 or text"),
        ({"separator": ""}, "a separator is needed"),
    ],
)
def test_layouts_that_cannot_be_are_refused(change: dict, message: str):
    with pytest.raises(SignalError, match=message):
        SignalCodec(SignalLayout(**change))


def test_a_client_keeps_the_newest_and_counts_what_does_not_fit():
    codec = SignalCodec(SignalLayout())
    with SignalClient(SignalLayout()) as client, UdpChannel() as controller:
        for number in (1.0, 2.0):
            signals = ControllerSignals(number, np.full(6, number), np.zeros(6))
            controller.send(codec.encode(signals), client.channel.address)
        controller.send(b"nonsense", client.channel.address)
        client.channel.wait(1.0)
        client.poll()
        assert client.newest.time == pytest.approx(2.0)
        assert (client.received, client.undecodable) == (2, 1)

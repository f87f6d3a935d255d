"""From the wire to a pose sample: frame, world, time on the station's clock, and what is not valid."""

from collections.abc import Callable
from contextlib import contextmanager

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from robots.pose import rotation_from_zyx
from systems.link.clock import ClockConfig
from systems.link.qualisys.client import MocapConfig
from systems.link.qualisys.loopback import loopback_latency
from systems.link.qualisys.receiver import MocapReceiver, MocapReceiverConfig
from systems.link.qualisys.server import CameraServerConfig, Send, VirtualCameraServer
from systems.samples import PoseSample
from tests.systems.link.qualisys.wire import TURNED, data_by_hand, until

X_WM = RigidTransform(RotationMatrix(rotation_from_zyx(np.array([1.2, 0.1, -0.4]))), [1.0, 2.0, 3.0])
X_BE = RigidTransform(RotationMatrix(rotation_from_zyx(np.array([-0.3, 0.8, 0.2]))), [0.0, 0.1, 0.2])
DELAY = 0.004  # s


class Rig:
    """A camera, a receiver, and a station's clock that the test sets."""

    def __init__(self, server: VirtualCameraServer, receiver: MocapReceiver, send: Send) -> None:
        self.server, self.receiver, self._send = server, receiver, send
        receiver.client.wait(5.0)
        until(lambda: server.streams)

    def expose(self, time_us: int, now: float, X_WB: RigidTransform | None = TURNED) -> PoseSample:
        self.server.publish(time_us, 1, {"tool": X_WB}, {"tool": 2e-4})
        return self.newest(now)

    def newest(self, now: float) -> PoseSample:
        found: list[PoseSample | None] = [None]
        until(lambda: found.append(self.receiver.poll(now)) or found[-1])
        assert found[-1] is not None
        return found[-1]

    def send(self, data: bytes) -> None:
        """A datagram from the server's own port, whatever it holds."""
        assert self.receiver.client.udp_port is not None
        self._send(data, ("127.0.0.1", self.receiver.client.udp_port))


@contextmanager
def rig_with(disturb: Callable[[Send], Send]):
    sends: list[Send] = []
    with VirtualCameraServer(CameraServerConfig(port=0), lambda s: sends.append(s) or disturb(s)) as server:
        config = MocapReceiverConfig(MocapConfig(port=server.port), ClockConfig(smallest_delay=DELAY))
        with MocapReceiver(config, X_WM, X_BE) as receiver:
            yield Rig(server, receiver, sends[0])


@pytest.fixture
def rig():
    with rig_with(lambda send: send) as running:
        yield running


def test_nothing_new_is_no_sample(rig: Rig):
    assert rig.receiver.poll(0.0) is None


def test_a_sample_is_the_tool_in_the_world_when_it_was_exposed(rig: Rig):
    sample = rig.expose(5_000_000, now=100.0)
    expected = X_WM @ TURNED @ X_BE
    # Single precision of half a metre in mm, and of a rotation, carried over the transforms.
    np.testing.assert_allclose(sample.X_WE.GetAsMatrix4(), expected.GetAsMatrix4(), rtol=0.0, atol=1e-6)
    assert sample.X_WE.rotation().IsValid(), "a rotation to the last digit, not only to single precision"
    assert (sample.valid, sample.residual) == (True, pytest.approx(2e-4))
    # The kernel states how long the frame waited for the poll: a moment.
    assert sample.time == pytest.approx(100.0 - DELAY, abs=0.2)


def test_stamps_and_not_arrivals_tell_the_time(rig: Rig):
    """A late frame is as old as its stamp says."""
    first = rig.expose(5_000_000, now=100.0)
    second = rig.expose(5_004_000, now=100.5)
    assert second.time - first.time == pytest.approx(0.004, abs=1e-9)


def test_a_lost_body_is_a_sample_that_is_not_valid(rig: Rig):
    rig.expose(4000, now=10.0)
    sample = rig.expose(8000, now=10.004, X_WB=None)
    assert not sample.valid
    assert sample.time == pytest.approx(10.004 - DELAY, abs=0.2)
    assert rig.receiver.report().samples.lost_body == 1


def test_only_the_newest_of_several_frames_is_given_out(rig: Rig):
    for number in range(1, 6):
        rig.server.publish(4000 * number, number, {"tool": RigidTransform([number, 0.0, 0.0])})
    fifth = (X_WM @ RigidTransform([5.0, 0.0, 0.0]) @ X_BE).translation()
    samples = [rig.newest(10.0)]
    while not np.allclose(samples[-1].X_WE.translation(), fifth):
        samples.append(rig.newest(10.0))
    counters = rig.receiver.report().samples
    assert counters.samples == len(samples)
    assert counters.samples + counters.skipped == 5


def test_what_has_been_overtaken_or_comes_twice_is_dropped(rig: Rig):
    rig.expose(12_000, now=10.0)
    for time_us in (12_000, 8000, 12_000):
        rig.send(data_by_hand(time_us, 1, [(TURNED, 0.1)]))
    assert rig.expose(16_000, now=10.004).valid
    assert rig.receiver.report().samples.late == 3


def test_a_measurement_that_begins_anew_is_followed_from_its_second_frame_on(rig: Rig):
    rig.expose(900_000_000, now=10.0)
    rig.server.publish(4000, 1, {"tool": TURNED})
    sample = rig.expose(8000, now=20.0)
    assert sample.valid
    assert sample.time == pytest.approx(20.0 - DELAY, abs=0.2)
    assert rig.receiver.report().clock.sessions == 2


def test_a_single_stamp_from_long_ago_changes_nothing(rig: Rig):
    rig.expose(900_000_000, now=10.0)
    rig.send(data_by_hand(4000, 1, [(TURNED, 0.1)]))
    assert rig.expose(900_004_000, now=10.004).valid
    assert rig.receiver.report().clock.sessions == 1


def test_a_stamp_that_does_not_fit_the_clock_makes_no_valid_sample(rig: Rig):
    for number in range(1, 31):
        assert rig.expose(
            40_000 * number, now=10.0 + 0.04 * number
        ).valid  # the clock is known after a second
    assert not rig.expose(60_000_000, now=11.24).valid
    assert rig.receiver.report().samples.wrong_time == 1


def test_a_frame_of_other_bodies_and_a_matrix_that_is_no_rotation_are_impossible(rig: Rig):
    rig.expose(4000, now=10.0)
    mirror = bytearray(data_by_hand(8000, 1, [(RigidTransform(), 0.1)]))
    mirror[-8:-4] = b"\0\0\x80\xbf"  # -1 as the last entry of the matrix
    for time_us, data in ((8000, bytes(mirror)), (12_000, data_by_hand(12_000, 1, [(TURNED, 0.1)] * 2))):
        rig.send(data)
        sample = rig.newest(10.0 + 1e-6 * time_us)
        assert not sample.valid
    assert rig.receiver.report().samples.impossible == 2


def test_a_bad_line_leaves_samples_in_their_order_each_once():
    """A fifth of the frames lost, a fifth doubled, a fifth overtaken by the next one."""
    rng, held = np.random.default_rng(4), []

    def disturb(send: Send) -> Send:
        def bad(data: bytes, address: tuple[str, int]) -> None:
            chance = rng.random()
            waiting, held[:] = list(held), []
            if chance < 0.2:
                held.append(data)
            elif chance > 0.4:
                for _ in range(1 + (chance < 0.6)):
                    send(data, address)
            for late in waiting:
                send(late, address)

        return bad

    with rig_with(disturb) as rig:
        found = []
        for number in range(1, 501):
            rig.server.publish(4000 * number, number, {"tool": RigidTransform([1e-3 * number, 0.0, 0.0])})
            sample = rig.receiver.poll(10.0 + 4e-3 * number)
            # A frame's age is real: one that waited for a busy machine may not fit the test's clock.
            found += [sample.X_WE] if sample is not None and sample.valid else []
        order = [(X_WM.inverse() @ X @ X_BE.inverse()).translation()[0] for X in found]
        assert np.all(np.diff(order) > 0.5e-3)
        counters = rig.receiver.report().samples
        assert counters.late > 100
        assert counters.samples - counters.wrong_time == len(order) > 200


def test_drift_of_the_cameras_clock_is_found_over_the_wire(rig: Rig):
    """Ten seconds of frames, as fast as the line takes them; the station's clock is the test's."""
    for number in range(1, 1001):
        exposed = 0.01 * number
        rig.expose(round(1e6 * exposed / (1.0 + 1e-3)), now=50.0 + exposed + DELAY)
    quality = rig.receiver.report().clock
    # The only jitter is real: how long frames waited in the kernel. 0.5 ms in 10 s are 50 ppm.
    assert quality.drift_ppm == pytest.approx(1000.0, abs=50.0)
    assert quality.sessions == 1


@pytest.mark.parametrize("transport", ["udp", "tcp"])
def test_the_latency_that_the_bench_prints_is_that_of_every_frame(transport: str):
    latencies = loopback_latency(transport, frames=50, period=1e-4)
    assert latencies.shape == (50,)
    assert np.all((latencies > 0.0) & (latencies < 1.0))


def test_refuses_a_receiver_for_which_every_sample_is_too_old():
    with pytest.raises(ValueError, match=r"oldest must be positive, got 0.0 s"):
        MocapReceiver(MocapReceiverConfig(oldest=0.0))

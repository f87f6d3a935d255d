# A None where there should be something fails a test as it should.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportAttributeAccessIssue=false
"""The client's defence: what counts as a message, what is answered, and what never moves a robot."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from systems.link.abb.messages import Command, Mode, decode_command
from systems.link.abb.schema import EgmRobot
from systems.link.abb.session import EgmSession
from systems.link.session import Link
from tests.systems.link.abb.reports import ELSEWHERE, HERE, PERIOD, SPEED, report

HOLD = Command(np.zeros(6), np.zeros(6))


class Rig:
    """A session that is fed by hand; time passes with every message."""

    def __init__(self, **options) -> None:
        self.session = EgmSession(SPEED, break_after=0.1, period=PERIOD, **options)
        self.now = 0.0

    def hear(self, data: bytes, sender=HERE, after: float = PERIOD):
        self.now += after
        return self.session.receive(data, sender, self.now)

    def counts(self) -> dict[str, int]:
        return {name: count for name, count in self.session.counters.as_dict().items() if count}


def test_a_stream_in_order_is_taken_and_answered_once_a_message():
    rig = Rig()
    for number in range(1, 11):
        assert rig.hear(report(number)).seqno == number
        first, second = (rig.session.reply(Mode.JOINT_SPEED, HOLD, rig.now) for _ in range(2))
        assert decode_command(first)[0] == number
        assert second is None
    assert rig.counts() == {"accepted": 10, "sessions": 1, "replies": 10}


def test_doubled_late_and_missing_messages_are_counted_and_only_new_ones_count():
    rig = Rig()
    taken = [number for number in (1, 2, 2, 5, 4, 3, 6) if rig.hear(report(number))]
    assert taken == [1, 2, 5, 6]
    assert rig.counts() == {"accepted": 4, "sessions": 1, "duplicates": 1, "missing": 2, "late": 2}


def test_the_count_may_wrap():
    rig = Rig()
    numbers = [2**32 - 2, 2**32 - 1, 0, 1]
    assert all(rig.hear(report(n, time=10.0 + PERIOD * k)) for k, n in enumerate(numbers))


def test_another_sender_is_ignored_from_the_first_message_on():
    rig = Rig()
    rig.hear(report(1))
    assert rig.hear(report(2), ELSEWHERE) is None
    assert rig.hear(report(2)) is not None
    assert rig.counts()["foreign"] == 1


def test_only_the_named_controller_is_heard():
    rig = Rig(host="192.168.125.1")
    assert rig.hear(report(1)) is None
    assert rig.hear(report(1), ("192.168.125.1", 6510)) is not None


def test_a_controller_that_begins_to_count_anew_is_a_new_session():
    """Three further messages are needed: one alone could be a stray datagram."""
    rig = Rig()
    for number in range(100, 110):
        rig.hear(report(number))
    epoch = rig.session.epoch
    later = [rig.hear(report(n, time=20.0 + PERIOD * n)) is not None for n in range(1, 8)]
    assert later == [False, False, False, True, True, True, True]
    assert rig.session.counters.sessions == 2
    assert rig.session.epoch > epoch


def test_a_jump_of_the_joints_is_not_believed_at_once():
    rig = Rig()
    rig.hear(report(1))
    assert rig.hear(report(2, np.full(6, 1.0))) is None
    assert rig.hear(report(3)) is not None
    assert rig.counts()["implausible"] == 1


def test_nothing_is_said_while_motors_are_off_or_egm_does_not_run():
    rig = Rig()
    for number, (running, motors) in enumerate([(False, True), (True, False), (False, False)], start=1):
        rig.hear(report(number, running=running, motors=motors))
        assert rig.session.link is Link.STOPPED
        assert rig.session.reply(Mode.JOINT, HOLD, rig.now) is None
    rig.hear(report(4))
    assert rig.session.reply(Mode.JOINT, HOLD, rig.now) is not None


def test_every_time_the_robot_begins_to_follow_commands_start_anew():
    rig = Rig()
    epochs = []
    for number in range(1, 13):
        rig.hear(report(number, running=number % 4 != 0))
        epochs.append(rig.session.epoch)
    assert np.flatnonzero(np.diff(epochs)).tolist() == [3, 7]
    assert rig.session.counters.stops == 3


def test_a_silence_breaks_the_link_and_the_same_controller_may_come_back_from_another_port():
    rig = Rig()
    rig.hear(report(1))
    epoch = rig.session.epoch
    rig.session.check(rig.now + 0.11)
    assert rig.session.link is Link.BROKEN
    assert rig.session.reply(Mode.JOINT, HOLD, rig.now) is None
    assert rig.hear(report(1, time=50.0), ("10.0.0.1", 50000), after=0.2) is None
    assert rig.hear(report(1, time=50.0), ELSEWHERE, after=0.0) is not None
    assert rig.session.epoch > epoch
    assert rig.session.counters.breaks == 1


def test_in_place_of_a_command_that_is_not_finite_the_last_safe_one_goes_out_standing_still():
    rig = Rig()
    rig.hear(report(1))
    rig.session.reply(Mode.JOINT_SPEED, Command(np.full(6, 0.3), np.full(6, 0.1)), rig.now)
    rig.hear(report(2))
    data = rig.session.reply(Mode.JOINT_SPEED, Command(np.full(6, np.nan), np.zeros(6)), rig.now)
    _, command = decode_command(data)
    np.testing.assert_allclose(command.position, 0.3)
    np.testing.assert_array_equal(command.velocity, 0.0)


def test_after_a_stop_an_old_command_is_never_replayed():
    rig = Rig()
    rig.hear(report(1))
    rig.session.reply(Mode.JOINT_SPEED, Command(np.full(6, 0.05), np.zeros(6)), rig.now)
    rig.hear(report(2, running=False))
    here = np.full(6, 0.01)
    rig.hear(report(3, here))
    _, command = decode_command(rig.session.reply(Mode.JOINT_SPEED, Command(np.full(6, np.nan)), rig.now))
    np.testing.assert_allclose(command.position, here)


def test_nor_after_joints_have_jumped():
    """The robot is another one, or stands elsewhere: what was safe before would be a way of 20 degrees."""
    rig = Rig()
    rig.hear(report(1))
    rig.session.reply(Mode.JOINT_SPEED, HOLD, rig.now)
    there = np.full(6, np.deg2rad(20.0))
    epoch = rig.session.epoch
    heard = [rig.hear(report(number, there)) for number in range(2, 8)]
    assert heard[-1] is not None
    assert rig.session.epoch == epoch + 1
    answer = rig.session.reply(Mode.JOINT_SPEED, Command(np.full(6, np.nan), np.zeros(6)), rig.now)
    _, command = decode_command(answer)
    assert command.position == pytest.approx(there, abs=1e-6)


@settings(max_examples=300, deadline=None)
@given(data=st.data())
def test_random_and_mutated_datagrams_change_nothing(data):
    """From anybody: not decoded, not answered. From the right port a spoiled message is not believed."""
    rig = Rig()
    rig.hear(report(1))
    rig.session.reply(Mode.JOINT, HOLD, rig.now)
    good = bytearray(report(2))
    kind = data.draw(st.sampled_from(["random", "cut", "flipped"]))
    if kind == "random":
        spoiled = data.draw(st.binary(max_size=300))
    elif kind == "cut":
        spoiled = bytes(good[: data.draw(st.integers(0, len(good) - 1))])
    else:
        for _ in range(data.draw(st.integers(1, 8))):
            good[data.draw(st.integers(0, len(good) - 1))] ^= 1 << data.draw(st.integers(0, 7))
        spoiled = bytes(good)
    assert rig.hear(spoiled, ELSEWHERE) is None
    assert rig.session.reply(Mode.JOINT, HOLD, rig.now) is None
    taken = rig.hear(spoiled)
    if taken is not None:  # then it is a message that a sound robot could have sent
        assert np.abs(taken.position).max() <= 2.0 * SPEED[0] * max(taken.time - 10.0, 1.0) + 0.1
    assert rig.hear(report(2 if taken is None else taken.seqno + 1, time=taken and taken.time + PERIOD))


@pytest.mark.parametrize("count", [10_000, pytest.param(200_000, marks=pytest.mark.slow)])
def test_spoiled_datagrams_cause_no_error_no_reply_and_no_change(count: int):
    """Twice as many datagrams: one from a stranger, one of garbage from the right port."""
    assert fuzz(count) == 0


def fuzz(count: int, seed: int = 0) -> int:
    """Feeds spoiled datagrams from a stranger and garbage from the right port; returns what was taken."""
    rng, rig = np.random.default_rng(seed), Rig()
    rig.hear(report(1))
    rig.session.reply(Mode.JOINT, HOLD, rig.now)
    pattern = np.frombuffer(report(2), np.uint8)
    taken = 0
    for number in range(count):
        spoiled = pattern.copy()
        places = rng.integers(0, len(spoiled), rng.integers(1, 20))
        spoiled[places] = rng.integers(0, 256, len(places))
        stranger = rig.hear(spoiled.tobytes(), ELSEWHERE, after=0.0)
        garbage = rig.hear(rng.bytes(int(rng.integers(0, 200))), HERE, after=0.0)
        taken += stranger is not None or garbage is not None
        taken += rig.session.reply(Mode.JOINT, HOLD, rig.now) is not None
        assert rig.session.last.seqno == 1, number
    return taken


def test_after_a_collision_nothing_is_answered_whatever_the_controller_says_later():
    rig = Rig()
    rig.hear(report(1))
    assert rig.session.reply(Mode.JOINT, HOLD, rig.now) is not None
    hit = EgmRobot.FromString(report(2))
    hit.CollisionInfo.collsionTriggered = True
    heard = rig.hear(hit.SerializeToString())
    assert heard is not None
    assert heard.has_collided
    assert not heard.is_ready
    assert rig.session.reply(Mode.JOINT, HOLD, rig.now) is None
    for number in range(3, 8):
        later = rig.hear(report(number))
        assert later is not None
        assert not later.is_ready
        assert rig.session.reply(Mode.JOINT, HOLD, rig.now) is None


def test_reports_of_a_robot_that_needs_more_than_it_has_are_counted():
    rig = Rig()
    for number, rate in enumerate((0.0, 80.0, 100.0, 130.0, 101.0), 1):
        message = EgmRobot.FromString(report(number))
        message.utilizationRate = rate
        heard = rig.hear(message.SerializeToString())
        assert heard is not None
        assert heard.utilization == pytest.approx(0.01 * rate)
    assert rig.session.egm.overloaded == 2


def test_what_came_but_is_no_use_is_known_by_its_reason():
    rig = Rig(host="192.168.125.1")
    rig.hear(report(1))
    assert rig.session.refused == "it is of 127.0.0.1, not of 192.168.125.1"
    rig.hear(b"nothing", ("192.168.125.1", 6510))
    assert rig.session.refused.startswith("not an EGM message")


@pytest.mark.parametrize(
    ("sent", "why"), [(b"nothing", "can be used: not an EGM message"), (report(1), "it repeats the same one")]
)
def test_a_controller_that_goes_on_with_messages_of_no_use_is_not_called_silent(sent: bytes, why: str):
    rig = Rig()
    rig.hear(report(1))
    for _ in range(30):
        rig.hear(sent)
    assert rig.session.link is Link.BROKEN
    assert why in rig.session.trouble


def test_a_silence_after_one_spoiled_message_is_one():
    rig = Rig()
    rig.hear(report(1))
    rig.hear(b"nothing")
    rig.session.check(rig.now + 1.0)
    assert rig.session.link is Link.BROKEN
    assert rig.session.trouble == ""


@pytest.mark.parametrize(("step", "told"), [(5000.0, "forward by 5000 s"), (-1234.0, "back by 1234 s")])
def test_a_step_of_the_clock_is_told_in_plain_seconds(step: float, told: str):
    rig = Rig()
    rig.hear(report(1, time=2000.0))
    rig.hear(report(2, time=2000.0 + PERIOD + step))
    assert told in rig.session.trouble

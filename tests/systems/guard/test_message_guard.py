"""Whatever is to be sent and however messages come, from one to the next no joint exceeds its limits."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.description.model import load_robot
from systems.guard.joint_limits import JointLimits
from systems.guard.message_guard import LONGEST_OWED, MOST_BRIDGED, MessageGuard, PassedTime

ROBOT = load_robot("irb1200")
LIMITS = JointLimits(ROBOT)
MIDDLE = 0.5 * (ROBOT.lower + ROBOT.upper)
PERIOD = 4e-3  # s


class Stream:
    """A guard before a stream of messages with stamps and a clock of its own."""

    def __init__(self, is_speed_only: bool = False) -> None:
        self.guard = MessageGuard(LIMITS, PERIOD, is_speed_only)
        self.guard.forget(MIDDLE)
        self.passed = PassedTime(PERIOD)
        self.stamp, self.now = 1000.0, 5.0
        self.passed.until(self.stamp, self.now)
        self.rows: list[tuple] = [(PERIOD, MIDDLE, np.zeros(6))]
        self.clocks = [(self.stamp, self.now)]

    def send(self, position, velocity, stamp: float = PERIOD, own: float = PERIOD, brakes: bool = False):
        """A message; the clocks have gone on by two times in s."""
        self.stamp, self.now = self.stamp + stamp, self.now + own
        passed = self.passed.until(self.stamp, self.now)
        sent = self.guard.braking(passed, 0.1) if brakes else self.guard.judged(position, velocity, passed)
        self.rows.append((passed, *(part.copy() for part in sent)))
        self.clocks.append((self.stamp, self.now))
        return sent

    def check(self) -> None:
        passed, position, velocity = (np.array(part) for part in zip(*self.rows, strict=True))
        # What was sent without time for it is as what was sent before.
        kept = np.flatnonzero((passed > 1e-5) | (np.arange(len(passed)) == 0))
        time = np.diff(np.cumsum(passed)[kept])[:, None]
        step, turn = np.diff(position[kept], axis=0), np.diff(velocity[kept], axis=0)
        slack = 1.0 + 2e-6
        assert (np.abs(velocity) <= ROBOT.speed * slack).all()
        assert (np.abs(step) <= ROBOT.speed * time * slack + 1e-12).all()
        assert (np.abs(turn) <= ROBOT.acceleration * time * slack + 1e-12).all()
        mean, spans = step / time, 0.5 * (time[1:] + time[:-1])
        assert (np.abs(np.diff(mean, axis=0)) <= ROBOT.acceleration * spans * slack + 1e-9).all()
        assert ((position >= ROBOT.lower) & (position <= ROBOT.upper)).all()

    def check_clocks(self) -> None:
        """The time that was counted: between any two messages none that either clock has not seen.

        On the own clock a message may be early by as much as the ones before it were late.
        """
        counted = np.cumsum([row[0] for row in self.rows])
        stamps, now = np.array(self.clocks).T
        n = len(stamps)
        first, last = np.triu_indices(n, 1)
        passed = counted[last] - counted[first]
        assert (passed <= now[last] - now[first] + LONGEST_OWED + 1e-9).all()
        # A clock that was set back is another one from there on; one that stands for long is none.
        steps = np.diff(stamps)
        rises, stands = np.cumsum(np.maximum(steps, 0.0)), np.cumsum(steps == 0.0)
        seen = np.concatenate([[0.0], rises]) + PERIOD * np.concatenate([[0.0], stands])
        assert (passed <= seen[last] - seen[first] + 1e-9).all()


times = st.sampled_from([0.0, 1e-4, 1e-3, PERIOD, PERIOD, PERIOD, 2 * PERIOD, 0.05, 1.0, -1.0])
anything = st.lists(st.floats(-10.0, 10.0), min_size=6, max_size=6).map(np.array)
brakes = st.sampled_from([False, False, False, True])
messages = st.lists(
    st.tuples(anything, anything, times, times.map(abs), brakes).map(lambda message: [message]),
    min_size=3,
    max_size=40,
)
# A sender that stands still, with its clock or without, and then sends what has piled up at once.
bursts = st.tuples(
    anything, anything, st.sampled_from([PERIOD, 0.02, 1.0]), st.integers(1, 60), st.sampled_from([0.0, 2e-4])
).map(
    lambda burst: [
        (burst[0], burst[1], PERIOD, burst[2], False),
        *((burst[0], burst[1], PERIOD, burst[4], False) for _ in range(burst[3])),
    ]
)


def check(rows: list[list[tuple]]) -> None:
    stream = Stream()
    for message in itertools.chain(*rows):
        stream.send(*message)
    stream.check()
    stream.check_clocks()


@settings(max_examples=60)
@given(rows=messages)
def test_whatever_is_sent_stays_within_speed_and_acceleration(rows):
    check(rows)


sequences = st.lists(st.one_of(messages, bursts), min_size=1, max_size=8).map(
    lambda parts: [row if isinstance(row, list) else [row] for part in parts for row in part]
)


@pytest.mark.slow
@settings(max_examples=40)
@given(sequence=sequences)
def test_nor_do_bursts_after_gaps_make_it_faster(sequence):
    check(sequence)


@pytest.mark.slow
@settings(max_examples=500)
@given(sequence=sequences)
def test_nor_does_one_of_many_sequences(sequence):
    check(sequence)


def cruise(stream: Stream, count: int, speed: float = 0.3, start: int = 0) -> None:
    for k in range(start + 1, start + count + 1):
        stream.send(MIDDLE + k * PERIOD * speed * ROBOT.speed, speed * ROBOT.speed)


def test_ordinary_motion_passes_unchanged():
    stream = Stream()
    for k in range(250):
        phase = 5.0 * k * PERIOD
        position = MIDDLE + 0.1 * ROBOT.speed / 5.0 * (1.0 - np.cos(phase))
        velocity = 0.1 * ROBOT.speed * np.sin(phase)
        sent = stream.send(position, velocity)
        np.testing.assert_array_equal(sent, (position, velocity))
    assert stream.guard.interventions == 0


def test_jitter_of_three_milliseconds_changes_nothing():
    """What comes late is followed by something early; the stamps are those of a clock."""
    stream, random = Stream(), np.random.default_rng(1)
    late = 0.003 * random.random(500)
    for k in range(1, 500):
        phase = 3.0 * k * PERIOD
        position = MIDDLE + 0.3 * ROBOT.speed / 3.0 * (1.0 - np.cos(phase))
        stream.send(position, 0.3 * ROBOT.speed * np.sin(phase), own=PERIOD + late[k] - late[k - 1])
    # Only until the first late one has paid for the early ones.
    assert stream.guard.interventions <= 10


def test_a_clock_that_steps_forward_allows_no_more_than_has_passed_here():
    stream = Stream()
    cruise(stream, 50, 0.1)
    before = stream.guard._position.copy()
    sent, _ = stream.send(MIDDLE + 0.5, 0.1 * ROBOT.speed, stamp=1.0)
    assert (np.abs(sent - before) <= ROBOT.speed * PERIOD * (1.0 + 1e-6)).all()
    stream.check()


@pytest.mark.parametrize("jitter", [0.0, 3e-4, 3e-3, 30e-3])
def test_in_sum_no_more_time_is_counted_than_has_passed_here(jitter: float):
    """It was up to two periods more, behind messages that came late or several at once."""
    passed, rng = PassedTime(PERIOD), np.random.default_rng(0)
    stamps = PERIOD * np.arange(2000)
    arrivals = np.maximum.accumulate(stamps + rng.uniform(0.0, jitter, len(stamps)))
    found = [passed.until(1000.0 + stamp, 5.0 + now) for stamp, now in zip(stamps, arrivals, strict=True)]
    counted = np.cumsum(found) - found[0]
    assert found[0] == PERIOD
    assert (counted - (arrivals - arrivals[0])).max() < 1e-9
    assert counted[-1] > stamps[-1] - jitter - 1e-9


def test_a_clock_that_was_set_back_is_the_clock_from_there_on():
    """Also when it comes to the time again at which it was set."""
    passed, set_back = PassedTime(PERIOD), 0.5
    stamps = 1000.0 + PERIOD * np.arange(400)
    stamps[100:] -= set_back
    found = np.array([passed.until(stamp, PERIOD * n) for n, stamp in enumerate(stamps)])
    np.testing.assert_allclose(np.delete(found, 100), PERIOD, rtol=1e-6)
    assert found[100] == 0.0


def test_after_a_second_without_messages_no_more_than_a_few_periods_are_made_good():
    stream = Stream()
    cruise(stream, 50, 0.1)
    before = stream.guard._position.copy()
    sent, _ = stream.send(MIDDLE + 1.0, 0.1 * ROBOT.speed, stamp=1.0, own=1.0)
    assert (np.abs(sent - before) <= MOST_BRIDGED * ROBOT.speed * PERIOD).all()
    stream.check()


@pytest.mark.parametrize("is_speed_only", [False, True])
def test_a_stop_is_even_and_ends_where_the_robot_is(is_speed_only: bool):
    stream = Stream(is_speed_only)
    for k in range(1, 51):
        share = min(1.0, k / 20)
        way = 0.3 * PERIOD * ROBOT.speed * (k * k / 40 if k <= 20 else k - 10)
        stream.send(MIDDLE + (0.0 if is_speed_only else way), 0.3 * share * ROBOT.speed)
    assert stream.guard.interventions <= 2
    while not stream.guard.is_at_rest:
        stream.send(None, None, brakes=True)
        assert len(stream.rows) < 120
    velocity = np.array([row[2] for row in stream.rows])[51:]
    np.testing.assert_allclose(
        velocity / ROBOT.speed, (velocity / ROBOT.speed)[:, :1].repeat(6, 1), atol=1e-9
    )
    assert (np.diff(velocity[:, 0]) <= 1e-12).all()
    assert len(velocity) * PERIOD == pytest.approx(0.1, abs=3 * PERIOD)
    if not is_speed_only:
        stream.check()


def test_without_anything_known_nothing_is_judged():
    guard = MessageGuard(LIMITS, PERIOD, False)
    position, velocity = guard.judged(np.full(6, np.nan), np.zeros(6), PERIOD)
    assert np.isnan(position).all()
    assert not velocity.any()


@pytest.mark.parametrize("share", [0.2, 0.5, 1.0])
def test_a_joint_that_is_sent_out_of_its_range_comes_to_rest_at_its_end(share):
    """Within the range it goes as it is told, until there is just room to brake."""
    stream, position, rate = Stream(), MIDDLE, np.zeros(6)
    for _ in range(3000):
        rate = np.minimum(rate + 0.5 * PERIOD * ROBOT.acceleration, share * ROBOT.speed)
        position = position + PERIOD * rate
        sent, _ = stream.send(position, rate)
    stream.check()
    assert sent == pytest.approx(ROBOT.upper, abs=1e-6)


uneven = st.lists(st.floats(5e-4, 0.04), min_size=2, max_size=40)


@pytest.mark.slow
@settings(max_examples=60)
@given(spans=uneven, share=st.floats(0.1, 1.0), side=st.sampled_from([-1.0, 1.0]))
def test_so_it_does_however_long_it_is_from_message_to_message(spans, share, side):
    """From the middle of its range it is led beyond an end, brakes as it may, and stands at it then."""
    stream, position, rate = Stream(), MIDDLE, np.zeros(6)
    for span in itertools.chain(itertools.islice(itertools.cycle(spans), 1200), 60 * [0.02]):
        rate = side * np.minimum(np.abs(rate) + 0.5 * span * ROBOT.acceleration, share * ROBOT.speed)
        position = position + span * rate
        sent, _ = stream.send(position, rate, stamp=span, own=span)
    stream.check()
    is_there = np.abs(position - MIDDLE) > 0.5 * (ROBOT.upper - ROBOT.lower)
    end = ROBOT.upper if side > 0.0 else ROBOT.lower
    np.testing.assert_allclose(sent[is_there], end[is_there], atol=1e-6)

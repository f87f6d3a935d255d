"""A path that is slowed: the time on it is smooth, its rates are true derivatives, the path is not left."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput

from systems.reference.path_time import MOST_CHANGES, PathTime
from systems.reference.paths import ReferenceConfig, SpeedOverride
from systems.reference.played_path import PlayedPath
from systems.reference.reference import Reference
from systems.reference.shapes import Circle

shares = st.floats(0.0, 1.0)
waits = st.floats(0.0, 0.7)


def asked(rows, slowing=0.5):
    """A path time after a share was asked for at each of some times after one another."""
    time, now = PathTime(slowing), 1.0
    for wait, share in rows:
        now += wait
        time = time.changed(now, now, share)
    return time, now


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(waits, shares), min_size=1, max_size=12))
def test_rate_is_between_the_shares_and_is_the_derivative(rows):
    time, last = asked(rows)
    t = np.linspace(max(0.0, last - 0.9), last + 1.5, 4001)
    s, rate, acceleration = time.at_times(t)
    np.testing.assert_allclose(
        np.transpose([time.at(each) for each in t]), (s, rate, acceleration), atol=1e-9
    )
    assert rate.min() >= -1e-12
    assert rate.max() <= 1.0 + 1e-12
    h = t[1] - t[0]
    # Central differences err by h^2/6 of the third derivative: of the rate at most 200 1/s^3 in 0.5 s, of
    # its rate 4000 1/s^4.
    np.testing.assert_allclose((s[2:] - s[:-2]) / (2.0 * h), rate[1:-1], atol=3e-4)
    np.testing.assert_allclose((rate[2:] - rate[:-2]) / (2.0 * h), acceleration[1:-1], atol=2e-3)
    assert rate[-1] == pytest.approx(rows[-1][1], abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(waits, shares), min_size=1, max_size=12))
def test_forgetting_and_the_state_keep_what_is_to_come(rows):
    time, last = asked(rows)
    t = np.linspace(last, last + 2.0, 50)
    for other in (time.forgetting(last), PathTime.from_state(time.to_state())):
        np.testing.assert_allclose(other.at_times(t), time.at_times(t), rtol=0.0, atol=1e-12)


def test_a_share_that_changes_at_every_tick_never_overflows():
    time, rng = PathTime(0.5), np.random.default_rng(1)
    for tick in range(2000):
        time = time.changed(0.004 * tick, 0.004 * tick, float(rng.uniform()))
        assert len(time.changes) <= MOST_CHANGES
    assert time.last_share < 1.0


def slowed(config, share=None):
    builder = DiagramBuilder()
    reference = builder.AddSystem(Reference(config, slowed_by=["cell"]))
    if share is not None:
        source = builder.AddSystem(ConstantVectorSource([share]))
        builder.Connect(source.get_output_port(), reference.GetInputPort("speed_share_cell"))
    log = LogVectorOutput(reference.GetOutputPort("path_time"), builder, 0.004)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(3.0)
    context = simulator.get_context()
    found = log.FindLog(context)
    return reference, reference.GetMyContextFromRoot(context), found.sample_times(), found.data().T


def test_the_least_share_counts_and_the_path_is_not_left():
    config = ReferenceConfig(Circle(), override=[SpeedOverride(1.0, 0.5)])
    reference, context, times, path_time = slowed(config, share=0.8)
    rate = path_time[:, 1]
    assert rate[times < 0.99].min() > 0.79
    assert rate[times > 1.6] == pytest.approx(0.5)
    ahead = reference.GetOutputPort("reference").Eval(context)
    t = np.array([2.5, 3.0, 3.1])
    X_WE, V_WE, _ = ahead.sample(t)
    on_path = reference.path.sample(np.array([ahead.path_time(time) for time in t]))
    np.testing.assert_allclose(X_WE, on_path[0], atol=1e-13)
    np.testing.assert_allclose(V_WE, 0.5 * on_path[1], atol=1e-13)
    np.testing.assert_allclose(ahead.moment(3.0).V_WE, V_WE[1], atol=1e-13)


def test_a_record_says_which_part_of_the_path_was_due_when():
    config = ReferenceConfig(Circle(), override=[SpeedOverride(0.5, 0.1), SpeedOverride(1.5, 1.0)])
    reference, context, times, path_time = slowed(config)
    path = PlayedPath(reference.path, times, path_time)
    ahead = reference.GetOutputPort("reference").Eval(context)
    # Half way between two ticks: a cubic through the rate errs by h^4/384 of 4000 1/s^3 there.
    for actual, expected in zip(
        path.sample(times[600:700] + 0.002), ahead.sample(times[600:700] + 0.002), strict=True
    ):
        np.testing.assert_allclose(actual, expected, atol=1e-6)
    late = times[-1] - path_time[-1, 0]
    assert late == pytest.approx(0.9)
    assert path.duration == pytest.approx(reference.path.duration + late)
    # At the planned speed again, blocks of ticks are as good as single ones.
    np.testing.assert_allclose(ahead.moment(2.8).X_WE, ahead.sample(np.array([2.8]))[0][0, :3], atol=1e-13)


def test_a_path_that_is_held_for_ever_is_refused():
    with pytest.raises(ValueError, match=r"reference\.override.*held for ever"):
        Reference(ReferenceConfig(override=[SpeedOverride(1.0, 0.0)]))

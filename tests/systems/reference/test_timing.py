"""Profiles from rest to rest: their integrals, their peaks, and how smooth they are."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import cumulative_simpson

from systems.reference.paths import ReferenceConfig, make_path
from systems.reference.timing import TIMINGS, PolynomialProfile, Profile, SineSquaredProfile

each_profile = pytest.mark.parametrize("make", TIMINGS.values(), ids=TIMINGS)


@each_profile
@given(acceleration=st.floats(0.01, 100.0), length=st.sampled_from([1.0, 2.0, 5.0]))
def test_two_integrals_of_the_acceleration_reach_the_length(
    make: type[Profile], acceleration: float, length: float
):
    profile = make(acceleration, length)
    t = np.linspace(0.0, profile.duration, 2001)
    s, rate, dd = profile.at_times(t)
    speed = cumulative_simpson(dd, x=t, initial=0)
    # Simpson's rule with 2000 intervals: about 1e-11 of the largest value on each integral, with a margin.
    np.testing.assert_allclose(rate, speed, atol=1e-9 * rate.max())
    np.testing.assert_allclose(s, cumulative_simpson(speed, x=t, initial=0), atol=1e-9 * length)
    assert profile.at(np.nextafter(profile.duration, 0.0))[0] == pytest.approx(length, rel=1e-14)


def test_the_sine_squared_profile_lasts_and_peaks_as_its_acceleration_says():
    profile = SineSquaredProfile(0.7)
    assert profile.duration == pytest.approx(2.0 * math.sqrt(2.0 / 0.7))
    quarter, half = profile.duration / 4.0, profile.duration / 2.0
    assert profile.at(quarter)[2] == pytest.approx(0.7)
    assert profile.at(half) == pytest.approx((0.5, math.sqrt(0.7 / 2.0), 0.0))
    assert profile.at(3.0 * quarter)[2] == pytest.approx(-0.7)


@each_profile
def test_one_time_and_many_times_give_the_same(make: type[Profile]):
    profile = make(0.7, 2.0)
    times = np.linspace(-0.1, profile.duration + 0.1, 173)
    one_by_one = np.transpose([profile.at(t) for t in times.tolist()])
    np.testing.assert_allclose(profile.at_times(times), one_by_one, atol=1e-15)


@each_profile
def test_the_largest_acceleration_is_the_one_asked_for(make: type[Profile]):
    profile = make.lasting(0.8, 3.0)
    assert profile.duration == pytest.approx(0.8)
    largest = np.abs(profile.at_times(np.linspace(0.0, 0.8, 20001))[2]).max()
    assert largest == pytest.approx(make.peak * 3.0 / 0.8**2, rel=1e-6)


@each_profile
def test_so_many_derivatives_are_continuous_where_the_motion_begins(make: type[Profile]):
    """Where the first n derivatives vanish and the next does not, s grows with the power n + 1 of time."""
    profile = make.lasting(1.0)
    growth = profile.at(2e-3)[0] / profile.at(1e-3)[0]
    assert math.log2(growth) == pytest.approx(profile.continuous_derivatives + 1, abs=0.02)


def test_a_path_says_how_smooth_it_is():
    for name, profile in TIMINGS.items():
        path = make_path(ReferenceConfig(timing=name))
        assert path.continuous_derivatives == profile.continuous_derivatives


def test_a_smooth_path_takes_as_long_as_its_acceleration_allows():
    config = ReferenceConfig(acceleration=2.0, timing="polynomial")
    path = make_path(config)
    assert path.dwell_start == pytest.approx(4.0 * math.sqrt(PolynomialProfile.peak / 2.0))


def test_an_unknown_timing_is_refused():
    with pytest.raises(ValueError, match="timing must be one of sine_squared, polynomial, got 'linear'"):
        make_path(ReferenceConfig(timing="linear"))

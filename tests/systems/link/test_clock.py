"""Two clocks: how fast one runs from the other, where a stamp lies, and what does not confuse them."""

import numpy as np
import pytest

from systems.link.clock import ClockConfig, StampClock

RATE = 250.0  # Hz
DELAY = 0.004  # s, of an idle line
JITTERS = {
    "uniform": lambda rng, n: rng.uniform(0.0, 3e-3, n),
    "exponential": lambda rng, n: rng.exponential(3e-3, n),
    "half normal": lambda rng, n: np.abs(rng.normal(0.0, 3e-3, n)),
}


def exposures(duration: float, drift: float, start_us: int = 7_000_000_000):
    """Station times and camera stamps of frames; the station's clock gains ``drift`` on the camera's."""
    time = np.arange(round(duration * RATE)) / RATE
    return 1000.0 + time, start_us + np.rint(1e6 * time / (1.0 + drift)).astype(int)


def observe(clock: StampClock, stamps: np.ndarray, arrivals: np.ndarray) -> None:
    for stamp, arrival in zip(stamps.tolist(), arrivals.tolist(), strict=True):
        clock.observe(stamp, arrival)


@pytest.mark.parametrize("jitter", JITTERS)
@pytest.mark.parametrize("drift", [100e-6, -100e-6, 0.0])
def test_a_minute_of_jittery_frames_gives_the_drift_and_the_place_of_a_stamp(jitter: str, drift: float):
    """In 25 runs the drift spread by 0.25 ppm, a place was off by 10 +- 7 us; four times that is allowed."""
    time, stamps = exposures(60.0, drift)
    arrivals = time + DELAY + JITTERS[jitter](np.random.default_rng(3), len(time))
    clock = StampClock(ClockConfig(smallest_delay=DELAY))
    observe(clock, stamps, arrivals)
    quality = clock.quality()
    assert quality.drift_ppm == pytest.approx(1e6 * drift, abs=1.0)
    assert clock.station_time(int(stamps[-1])) == pytest.approx(time[-1], abs=60e-6)
    assert quality.drift_sigma_ppm < 1.0
    assert quality.offset_sigma < 30e-6
    jitters = np.quantile(arrivals - time - DELAY, [0.5, 0.95, 0.99])
    # A bin of a second has 250 frames: its 99th percentile is known to a third at worst.
    np.testing.assert_allclose(list(quality.jitter.values()), jitters, rtol=0.1)


def test_a_fast_drift_is_known_after_ten_seconds_from_bins_that_began_without_it():
    """At 1000 ppm a bin is 1 ms from end to end; ten of them know the slope to 2.5 ppm."""
    time, stamps = exposures(10.5, 1e-3)
    clock = StampClock(ClockConfig(smallest_delay=DELAY))
    observe(clock, stamps, time + DELAY + np.random.default_rng(1).uniform(0.0, 1e-3, len(time)))
    assert clock.quality().drift_ppm == pytest.approx(1000.0, abs=10.0)


def test_the_stated_sigmas_are_those_of_repeated_runs():
    """25 runs: a standard deviation is known to 14 %, so within a factor of 1.6."""
    found = []
    for seed in range(25):
        time, stamps = exposures(20.0, 100e-6)
        clock = StampClock(ClockConfig(smallest_delay=DELAY))
        observe(clock, stamps, time + DELAY + np.random.default_rng(seed).exponential(3e-3, len(time)))
        quality = clock.quality()
        error = clock.station_time(int(stamps[-1])) - time[-1]
        found.append([quality.drift_ppm, error, quality.drift_sigma_ppm, quality.offset_sigma])
    drift, error, drift_sigma, offset_sigma = np.array(found).T
    assert np.mean(drift_sigma) / np.std(drift) == pytest.approx(1.0, rel=0.6)
    assert np.mean(offset_sigma) / np.std(error) == pytest.approx(1.0, rel=0.6)


def test_frames_that_wait_in_a_pattern_do_not_look_like_a_drift():
    """Most frames wait while a controller is answered; which ones do not shifts with the two periods.

    The tenth percentiles of the bins drift by 2.2 ppm here, the earliest frames by a tenth of that.
    """
    time, stamps = exposures(20.0, 0.0)
    phase = (time - 1000.0) / 4.032e-3 % 1.0
    share = 0.1 + 0.05 * (time - 1000.0) / 20.0
    arrivals = time + DELAY + np.random.default_rng(2).exponential(2e-5, len(time))
    arrivals[phase > share] += 2e-4  # a tenth is read at once, and more towards the end
    clock = StampClock(ClockConfig(smallest_delay=DELAY))
    observe(clock, stamps, arrivals)
    assert clock.quality().drift_ppm == pytest.approx(0.0, abs=1.0)


def test_stamps_that_are_far_off_do_not_move_it():
    time, stamps = exposures(60.0, 100e-6)
    rng = np.random.default_rng(1)
    arrivals = time + DELAY + rng.exponential(3e-3, len(time))
    wild = rng.random(len(time)) < 0.03
    spoiled = stamps.copy()
    spoiled[wild] += rng.integers(-2_000_000, 2_000_000, wild.sum())
    clock = StampClock(ClockConfig(smallest_delay=DELAY))
    observe(clock, spoiled, arrivals)
    assert clock.quality().sessions == 1
    assert clock.quality().drift_ppm == pytest.approx(100.0, abs=10.0)
    assert clock.station_time(int(stamps[-1])) == pytest.approx(time[-1], abs=0.5e-3)


def test_a_stall_of_a_second_is_no_new_session():
    time, stamps = exposures(30.0, 100e-6)
    arrivals = time + DELAY + np.random.default_rng(1).uniform(0.0, 1e-3, len(time))
    stalled = (time >= 1015.3) & (time < 1016.3)
    arrivals[stalled] = 1016.3 + DELAY
    clock = StampClock(ClockConfig(smallest_delay=DELAY))
    observe(clock, stamps, arrivals)
    assert clock.quality().sessions == 1
    assert clock.quality().drift_ppm == pytest.approx(100.0, abs=2.0)
    assert clock.station_time(int(stamps[-1])) == pytest.approx(time[-1], abs=100e-6)


@pytest.mark.parametrize("jump_us", [10_000_000, -300_000, 50_000])
def test_a_clock_that_is_set_anew_is_known_again_two_seconds_later(jump_us: int):
    time, stamps = exposures(30.0, 0.0)
    stamps[time >= 1020.4] += jump_us
    clock = StampClock(ClockConfig(smallest_delay=DELAY))
    arrivals = time + DELAY + np.random.default_rng(1).uniform(0.0, 1e-3, len(time))
    observe(clock, stamps[time < 1023.0], arrivals[time < 1023.0])
    assert clock.quality().sessions == 2
    assert clock.station_time(int(stamps[-1])) == pytest.approx(time[-1], abs=1e-3)


def test_one_frame_places_a_stamp_and_none_does_not():
    clock = StampClock(ClockConfig(smallest_delay=DELAY))
    assert np.isnan(clock.station_time(5))
    clock.observe(1_000_000, 20.0)
    assert clock.station_time(1_500_000) == pytest.approx(20.5 - DELAY)
    assert np.isnan(clock.quality().drift_ppm)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"bin_length": 0.0}, "must be positive and smallest_delay not negative, got 0.0 s"),
        ({"step": np.nan}, "must be positive"),
        ({"smallest_delay": -1e-3}, "smallest_delay not negative"),
        ({"horizon": 4}, "horizon must be 5 bins or more, got 4"),
    ],
)
def test_refuses_what_no_clock_can_be(change: dict, message: str):
    with pytest.raises(ValueError, match=f"camera clock: .*{message}"):
        StampClock(ClockConfig(**change))

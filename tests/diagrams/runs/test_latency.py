"""Delays that are put into a station come out of it."""

import numpy as np
import pytest
from scipy.signal import lfilter

from diagrams.hardware_link import EndedOnRequest, StationError
from diagrams.runs.latency import LatencyConfig, LatencyRecord, measure_latency, motion
from diagrams.scenario.scenario import load_scenario
from experiments.station.found_delays import scenario_with
from experiments.station.latency import ImpossibleDelayError, Latency, delay_between, evaluate
from robots.description.model import load_robot
from systems.link.abb.messages import decode_command
from systems.link.clock import ClockQuality
from tests.diagrams.lockstep import Lockstep

ROBOT = load_robot("irb1200")


def measured(*settings: str, **config) -> Latency:
    scenario = load_scenario("cell", list(settings))
    wire = Lockstep(scenario)
    record = measure_latency(
        scenario,
        ROBOT,
        LatencyConfig(**{"duration": 6.0, **config}),
        wire.link,
        wire.camera(),
        now=wire.now,
    )
    return evaluate(record)


@pytest.mark.slow
@pytest.mark.parametrize(
    "dead_time",
    [0.012, 0.052, 0.14],
)
def test_a_dead_time_is_found_to_a_millisecond(dead_time: float):
    found = measured(f"station.drive.dead_time={dead_time}", duration=8.0)
    assert found.dead_time == pytest.approx(dead_time, abs=5e-4)
    assert found.cycle == pytest.approx(4.032e-3)
    # The camera of this rig tells its exposures themselves.
    assert found.camera == pytest.approx(0.0, abs=3e-4)


@pytest.mark.slow
def test_of_a_robot_that_does_not_follow_no_delay_is_measured():
    with pytest.raises(StationError, match=r"joint 1 was told to move by \d\.\d degrees and moved by 0\.00"):
        measured("station.faults.deaf_at=0", duration=4.0)


@pytest.mark.slow
def test_lost_and_late_messages_only_add_what_they_cost():
    """Jitter of up to 3 ms makes a reply miss a cycle now and then, a lost one holds the last command."""
    found = measured(
        "station.drive.dead_time=0.052", "station.faults.loss=0.02", "station.faults.jitter=0.003"
    )
    assert 0.052 - 5e-4 < found.dead_time < 0.052 + 3e-3


@pytest.mark.slow
@pytest.mark.parametrize(("halts", "refused"), [([3.0], None), ([3.0, 6.0, 9.0, 12.0, 15.0], "set anew")])
def test_a_clock_that_is_set_anew_begins_the_measurement_again(halts: list[float], refused: str | None):
    """The cell stands still for 0.06 s and stays behind; often enough, and there is nothing to measure."""
    scenario = load_scenario("cell", ["station.drive.dead_time=0.052"])
    wire = Lockstep(scenario)
    wire.halts = [(time, 0.06, False) for time in halts]

    def record() -> LatencyRecord:
        return measure_latency(
            scenario, ROBOT, LatencyConfig(duration=6.0), wire.link, wire.camera(), now=wire.now
        )

    if refused:
        with pytest.raises(StationError, match=refused):
            record()
    else:
        undisturbed_since = record()
        # Whole, but for two cycles; noticed within two seconds, each of which is one bin of the clock.
        assert 6.0 <= undisturbed_since.stamp[-1] - undisturbed_since.stamp[0] + 0.0081 < 6.1
        assert 3.0 < undisturbed_since.stamp[0] - wire.stamps[0] < 5.3
        assert evaluate(undisturbed_since).dead_time == pytest.approx(0.052, abs=5e-4)


def test_the_standard_error_of_a_delay_is_how_far_it_is_off():
    """White noise on the effect, and noise that remembers itself for ten samples; twenty times each."""
    time = np.arange(0.0, 10.0, 4e-3)
    cause, _ = motion(LatencyConfig(duration=10.0), time)
    effect, _ = motion(LatencyConfig(duration=10.0), time - 0.02)
    rng = np.random.default_rng(5)
    for memory in (0.0, 0.9):
        off = []
        for _ in range(20):
            noise = lfilter([1.0], [1.0, -memory], rng.normal(0.0, 1e-4, len(time)))
            delay, _, sigma = delay_between(time, cause, time, (effect + noise)[:, None], 1)
            off.append((delay - 0.02) / sigma)
        # The root mean square of twenty normal numbers is within a factor of two of one.
        assert 0.5 < np.sqrt(np.mean(np.square(off))) < 2.0


def record_of(delay: float, camera_delay: float, jitter: float) -> LatencyRecord:
    """A motion that follows its command after a delay, seen after another one."""
    time = 0.004 * np.arange(3000)
    config = LatencyConfig(duration=12.0)
    (commanded, _), (moved, _), (seen, _) = (
        motion(config, time - late) for late in (0.0, delay, delay + camera_delay)
    )
    clock = ClockQuality(3000, 12.0, 0.0, 0.1, 1e-6, {"50%": jitter, "99%": jitter}, 1)
    position = np.stack([seen, seen, seen], axis=1)
    return LatencyRecord(time, commanded, moved, time, time, position, time, clock, clock, {})


@pytest.mark.parametrize(
    ("delays", "reason"),
    [
        ((-0.02, 0.01, 0.0), r"loop takes -20\.\d+ ms .* an effect before its cause"),
        ((0.05, -0.02, 0.0), r"camera's delay is -20\.\d+ ms"),
        ((0.05, 0.01, 0.08), r"half of the messages of the controller come 80\.0 ms later"),
    ],
)
def test_delays_that_no_station_has_are_a_failed_measurement(delays, reason):
    with pytest.raises(ImpossibleDelayError, match=reason):
        evaluate(record_of(*delays))
    assert evaluate(record_of(0.05, 0.01, 0.002)).camera == pytest.approx(0.01, abs=1e-5)


def test_a_delay_between_sampled_motions_is_found_to_microseconds():
    """The effect is a cubic of the cause, sampled at other times; without noise nothing is left."""
    time = np.arange(0.0, 10.0, 4e-3)
    cause, _ = motion(LatencyConfig(duration=10.0), time)
    later = np.arange(0.5, 9.5, 7e-3)
    moved, _ = motion(LatencyConfig(duration=10.0), later - 0.0371)
    effect = np.stack([3.0 * moved + 40.0 * moved**2, 1.0 - moved**3], axis=1)
    delay, rest, _ = delay_between(time, cause, later, effect, 3)
    assert delay == pytest.approx(0.0371, abs=2e-6)
    assert rest < 1e-6


def test_the_motion_begins_and_ends_at_rest_and_its_speed_is_its_derivative():
    config, h = LatencyConfig(duration=8.0), 1e-6
    time = np.linspace(0.0, 8.0, 200)
    position, speed = motion(config, time)
    differences = (motion(config, time + h)[0] - motion(config, time - h)[0]) / (2.0 * h)
    np.testing.assert_allclose(speed, differences, atol=1e-8)
    np.testing.assert_allclose([position[0], speed[0], position[-1], speed[-1]], 0.0, atol=1e-12)
    assert np.abs(position).max() <= np.deg2rad(config.amplitude_deg)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"joint": 7}, "joint must be 1 to 6, got 7"),
        ({"duration": 1.0}, "duration must be at least 4 s"),
        ({"amplitude_deg": 30.0}, r"amplitude_deg in \(0, 20\]"),
        ({"joint": 2, "amplitude_deg": 20.0, "duration": 4.0}, None),
    ],
)
def test_what_cannot_be_moved_is_refused(config: dict, message: str | None):
    if message is None:
        home = ["home_deg=[0, 0, 0, 0, 0, 0]"]
        assert measured(*home, **config).dead_time < 1e-3  # there is room for that
    else:
        with pytest.raises(ValueError, match=message):
            measured(**config)


@pytest.mark.slow
def test_the_delays_become_a_scenario(tmp_path):
    found = measured("station.drive.dead_time=0.052")
    path = tmp_path / "found.yaml"
    path.write_text(scenario_with("cell", found))
    scenario = load_scenario(str(path))
    assert scenario.station.drive.dead_time == pytest.approx(found.dead_time, abs=1e-6)
    assert scenario.station.interface == "egm"


@pytest.mark.slow
def test_whoever_ends_it_gets_a_smooth_stop():
    scenario = load_scenario("cell")
    wire = Lockstep(scenario)
    ended: list[float] = []

    def is_asked_to_end() -> bool:
        ended.extend([wire.time] * (wire.cell.time > 2.5 and not ended))
        return bool(ended)

    config = LatencyConfig(duration=6.0)
    with pytest.raises(EndedOnRequest):
        measure_latency(
            scenario, ROBOT, config, wire.link, wire.camera(), now=wire.now, is_asked_to_end=is_asked_to_end
        )
    assert wire.time < ended[0] + 1.0
    speeds = [np.asarray(decode_command(data)[1].velocity, dtype=float) for _, data in wire.sent]
    assert np.abs(speeds[-30]).max() > 0.0
    assert np.abs(speeds[-1]).max() == 0.0

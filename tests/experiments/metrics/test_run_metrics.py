"""The numbers of a comparison, on runs whose errors are known."""

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.metrics.iso9283 import iso_9283, path_distance, repeatability
from experiments.metrics.run_metrics import (
    best_law,
    error_metrics,
    summary,
    timing,
    transient_metrics,
    with_timing,
)
from experiments.report.files import write_json
from tests.experiments.synthetic import DWELL, comparison, displaced, make_log, rectangle, straight

TIME = np.arange(0.0, 6.002, 0.004)
ROUNDING = 1e-9  # mm and degrees; double precision on metres leaves about 1e-12


def test_a_constant_offset_is_its_own_largest_and_static_error():
    offset = np.array([0.01, -0.02, 0.03, 1e-3, -2e-3, 2e-3])
    X = rectangle(TIME)
    numbers = error_metrics(make_log(TIME, X, displaced(X, offset)), "true")
    for name in ("max", "static"):
        assert numbers[f"{name}_mm"] == pytest.approx([1.0, 2.0, 2.0], abs=ROUNDING)
        assert numbers[f"{name}_deg"] == pytest.approx(np.rad2deg([0.01, 0.02, 0.03]), abs=ROUNDING)
    assert numbers["max_norm_mm"] == pytest.approx(3.0, abs=ROUNDING)
    assert numbers["rms_norm_mm"] == pytest.approx(3.0, abs=ROUNDING)
    assert numbers["max_angle_deg"] == pytest.approx(np.rad2deg(np.sqrt(14.0) * 0.01), abs=ROUNDING)


def test_errors_before_the_path_begins_do_not_count():
    X = straight(TIME)
    e = np.where(TIME < 1.999, 0.5, 0.001)[:, None] * np.array([0, 0, 0, 1.0, 0, 0])
    numbers = error_metrics(make_log(TIME, X, displaced(X, e), start=2.0), "true")
    assert numbers["max_mm"] == pytest.approx([1.0, 0.0, 0.0], abs=ROUNDING)


def test_static_is_the_mean_of_the_last_half_second_so_that_vibration_cancels():
    X = straight(TIME, speed=0.0)
    vibration = 1e-3 * np.sin(2.0 * np.pi * 10.0 * TIME)  # five whole periods in the window
    e = np.zeros((len(TIME), 6))
    e[:, 4] = vibration + 2e-4
    numbers = error_metrics(make_log(TIME, X, displaced(X, e)), "true")
    # The window holds both of its ends, one sample more than five periods.
    assert numbers["static_mm"][1] == pytest.approx(0.2, abs=1.0 / 125)
    assert numbers["max_mm"][1] == pytest.approx(1.2, abs=0.01)


def test_a_path_that_ends_without_a_dwell_has_no_static_error():
    X = straight(TIME)
    log = make_log(TIME, X, displaced(X, np.array([0, 0, 0, 1e-3, 0, 0])))
    ending = dataclasses.replace(log, dwell_start=log.path_end)
    run = summary("nominal", {"pbvs": [ending]})["runs"]["pbvs"]["true"]
    assert run["static_mm"] == run["static_deg"] == [None, None, None]
    assert None not in run["max_mm"]


def test_missing_measurements_are_left_out():
    X = straight(TIME)
    measured = displaced(X, np.array([0, 0, 0, 1e-3, 0, 0]))
    measured[100:400] = np.nan
    numbers = error_metrics(make_log(TIME, X, X, measured), "measured")
    assert numbers["max_mm"] == pytest.approx([1.0, 0.0, 0.0], abs=ROUNDING)
    assert numbers["rms_norm_mm"] == pytest.approx(1.0, abs=ROUNDING)


def test_a_run_without_any_measurement_says_so_in_valid_json(tmp_path):
    X = straight(TIME)
    result = summary("blind", {"pbvs": [make_log(TIME, X, X, np.full_like(X, np.nan))]})
    assert result["runs"]["pbvs"]["measured"]["max_mm"] == [None, None, None]
    assert result["runs"]["pbvs"]["true"]["max_norm_mm"] == 0.0
    write_json(tmp_path / "summary.json", result)
    assert json.loads((tmp_path / "summary.json").read_text()) == result


def test_a_log_that_ends_before_its_path_is_refused():
    X = straight(TIME)
    with pytest.raises(ValueError, match=r"law 'pbvs': no sample between path_start 9 s"):
        error_metrics(make_log(TIME, X, X, start=9.0), "true")


@given(rate=st.floats(1.0, 30.0))
def test_a_first_order_response_settles_after_three_time_constants_without_overshoot(rate):
    e = np.exp(-rate * TIME)[:, None] * np.array([0, 0, 0, 0.01, 0.01, 0.01])
    numbers = transient_metrics(TIME, e)
    # exp(-rate t) = 0.05; found at the next sample of 4 ms.
    assert 0.0 <= numbers["settling_s"] - np.log(20.0) / rate <= 0.004 + 1e-12
    assert numbers["overshoot_mm"] == [0.0, 0.0, 0.0]


@given(damping=st.floats(0.2, 0.8), frequency=st.floats(8.0, 25.0), sign=st.sampled_from([-1.0, 1.0]))
def test_a_damped_response_overshoots_by_the_textbook_amount(damping, frequency, sign):
    root = np.sqrt(1.0 - damping**2)
    phase = root * frequency * TIME
    response = np.exp(-damping * frequency * TIME) * (np.cos(phase) + damping / root * np.sin(phase))
    e = sign * response[:, None] * np.array([0, 0, 0, 0.01, 0, 0])
    overshoot = transient_metrics(TIME, e)["overshoot_mm"]
    # The peak falls between samples: at most (w dt / 2)^2 / 2 of it is lost, 0.13 percent at 25 rad/s.
    assert overshoot[0] == pytest.approx(10.0 * np.exp(-np.pi * damping / root), rel=2e-3)
    assert overshoot[1:] == [0.0, 0.0]


def test_an_error_that_starts_small_or_never_settles_has_no_transient():
    small, stubborn = np.zeros((len(TIME), 6)), np.full((len(TIME), 6), 0.01)
    small[:, 3] = 9e-4
    for e in (small, stubborn):
        assert set(transient_metrics(TIME, e).values()) == {None}


def test_pure_lag_along_the_path_is_an_error_of_the_tip_but_not_of_the_path():
    late = 0.1
    log = make_log(TIME, rectangle(TIME), rectangle(np.maximum(TIME - late, 0.0)))
    assert error_metrics(log, "true")["max_norm_mm"] > 10.0
    # Round a corner at rest the lag cuts nothing off, and a chord of a straight line is the line.
    assert iso_9283([log], "true")["AT_mm"] == pytest.approx(0.0, abs=1e-6)


def test_an_offset_across_the_path_is_path_accuracy():
    X = straight(TIME)
    log = make_log(TIME, X, displaced(X, np.array([0, 0, 0, 0, 3e-3, 4e-3])))
    numbers = iso_9283([log], "true")
    assert numbers["AT_mm"] == pytest.approx(5.0, abs=ROUNDING)
    assert numbers["AP_mm"] == pytest.approx(5.0, abs=ROUNDING)
    assert numbers["RP_mm"] is None
    assert numbers["RT_mm"] is None


def test_a_path_that_crosses_itself_is_not_mistaken_for_its_other_branch():
    time = np.linspace(0.0, 10.0, 1001)
    there_and_back = np.abs(time - 5.0)[:, None] * np.array([1.0, 0.0, 0.0])
    away = np.array([[0.5, 0.0, 0.0]])  # lies on the line, but four seconds from where it should be
    # The search reaches half a second, 0.5 m, and up to two segments of 10 mm further.
    assert path_distance(np.array([0.5]), away, time, there_and_back)[0] == pytest.approx(3.5, abs=0.025)


def test_repeatability_is_mean_plus_three_deviations_from_the_barycentre():
    square = np.array([[3.0, 0, 0], [-3.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
    # Radii 3, 3, 1, 1: mean 2, sample deviation 2 / sqrt(3).
    assert repeatability(square) == pytest.approx(2.0 + 3.0 * 2.0 / np.sqrt(3.0))


def test_cycles_scatter_about_their_barycentre():
    X = straight(TIME)
    sides = [np.array([0, 0, 0, 0, y, 0]) for y in (1e-3, 3e-3)]
    numbers = iso_9283([make_log(TIME, X, displaced(X, e)) for e in sides], "true")
    assert numbers["AP_mm"] == pytest.approx(2.0, abs=ROUNDING)
    assert numbers["RP_mm"] == pytest.approx(1.0, abs=ROUNDING)
    assert numbers["RT_mm"] == pytest.approx(1.0, abs=ROUNDING)
    assert numbers["cycles"] == 2


def test_cycles_that_were_slowed_are_compared_at_the_same_places_of_the_path():
    """One 0.1 mm aside at full speed, one 0.3 mm at changing speed, which comes to its end later."""
    X = straight(TIME)
    cycles = [make_log(TIME, X, displaced(X, np.array([0, 0, 0, 0, 1e-4, 0])))]
    longer = np.arange(0.0, 1.5 * TIME[-1], TIME[1] - TIME[0])
    on_path = np.minimum(longer - 0.1 * (1.0 - np.cos(longer)), TIME[-1])
    on_path = np.maximum.accumulate(on_path)
    X = straight(on_path)
    slowed = make_log(longer, X, displaced(X, np.array([0, 0, 0, 0, 3e-4, 0])))
    arrived = float(longer[np.argmax(on_path >= TIME[-1])])
    cycles.append(
        dataclasses.replace(slowed, path_time=on_path, dwell_start=arrived - DWELL, path_end=arrived)
    )
    for order in (cycles, cycles[::-1]):
        numbers = iso_9283(order, "true")
        assert numbers["AP_mm"] == pytest.approx(0.2, abs=ROUNDING)
        assert numbers["RP_mm"] == pytest.approx(0.1, abs=ROUNDING)
        assert numbers["AT_mm"] == pytest.approx(0.2, abs=1e-3)  # to a polyline of samples
        assert numbers["RT_mm"] == pytest.approx(0.1, abs=ROUNDING)


def test_cycles_of_different_length_are_compared_as_far_as_all_of_them_go():
    X = straight(TIME)
    shorter = make_log(TIME[:-5], X[:-5], displaced(X[:-5], np.array([0, 0, 0, 0, 2e-4, 0])))
    for cycles in ([make_log(TIME, X, X), shorter], [shorter, make_log(TIME, X, X)]):
        numbers = iso_9283(cycles, "true")
        assert numbers["AT_mm"] == pytest.approx(0.1, abs=1e-3)
        assert numbers["RT_mm"] == pytest.approx(0.1, abs=ROUNDING)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_cycle_that_a_station_broke_off_spoils_none_of_the_others(number: int):
    X = straight(TIME)
    whole = [make_log(TIME, X, displaced(X, np.array([0, 0, 0, 0, e, 0]))) for e in (1e-4, 3e-4)]
    half = len(TIME) // 2
    broken = make_log(TIME[:half], X[:half], displaced(X[:half], np.array([0, 0, 0, 0, 5e-2, 0])))
    cycles = list(whole)
    cycles.insert(number, dataclasses.replace(broken, ended_early="the controller stopped"))
    numbers = iso_9283(cycles, "true")
    assert numbers == iso_9283(whole, "true") | {"cycles": 3}
    result = summary("x", {"pbvs": cycles})["runs"]["pbvs"]
    assert result["unfinished"] == f"cycle {number + 1}: the controller stopped"


def test_a_law_of_which_every_cycle_was_broken_off_has_the_figures_of_its_first():
    X = straight(TIME)
    broken = dataclasses.replace(make_log(TIME[:40], X[:40], X[:40]), ended_early="the controller stopped")
    numbers = iso_9283([broken, broken], "true")
    assert numbers["cycles"] == 2
    assert numbers["RP_mm"] is None


def test_the_same_logs_give_the_same_bytes_and_no_wall_time(tmp_path):
    for name, wall_time in (("one", 1.0), ("two", 2.0)):
        logs = comparison(cycles=2)
        logs["pbvs"] = [dataclasses.replace(log, wall_time=wall_time) for log in logs["pbvs"]]
        write_json(tmp_path / name, summary("misaligned", logs))
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
    assert (tmp_path / "one").read_text().endswith("}\n")


def test_the_best_law_is_the_one_with_the_smallest_largest_error():
    result = summary("misaligned", comparison())
    largest = {law: run["true"]["max_norm_mm"] for law, run in result["runs"].items()}
    assert best_law(result) == min(largest, key=lambda law: largest[law])
    assert result["runs"]["pbvs"]["guard"] == {"stale_measurement": 1, "velocity_limit": 1}


def test_real_time_factor_is_simulated_over_wall_time():
    X = straight(TIME)
    run = timing({"pbvs": [make_log(TIME, X, X)] * 2})["runs"]["pbvs"]
    assert run == {"wall_s": 5.0, "simulated_s": 12.0, "real_time_factor": 2.4}


def test_laps_and_what_was_learnt_stand_in_a_summary_only_where_they_are():
    time = np.arange(0.0, 10.0, 0.004)
    wanted = rectangle(time)
    log = make_log(time, wanted, wanted)
    plain = summary("test", {"pbvs": [log]})["runs"]["pbvs"]
    assert set(plain) == {"true", "measured", "guard"}
    log = dataclasses.replace(log, lap_starts=(0.0, 4.0), learnt={"mass_kg": 7.0})
    run = summary("test", {"pbvs": [log]})["runs"]["pbvs"]
    assert {key: run[key] for key in plain} == plain
    assert [lap["max_norm_mm"] for lap in run["laps"]] == [0.0, 0.0]
    assert run["learnt"] == {"mass_kg": 7.0}
    slowed = dataclasses.replace(log, path_time=0.5 * time)
    assert summary("test", {"pbvs": [slowed]})["runs"]["pbvs"]["times_planned"] == pytest.approx(2.0)


def test_the_cost_of_a_tick_is_told_beside_what_was_learnt_and_leaves_the_summary_alone():
    time = np.arange(0.0, 10.0, 0.004)
    wanted = rectangle(time)
    seconds = np.concatenate([np.full(10, 1.0), np.full(99, 1e-4), [1e-3]])
    log = dataclasses.replace(make_log(time, wanted, wanted), tick_seconds=seconds, learnt={"mass_kg": 7.0})
    result, times = summary("test", {"pbvs": [log]}), timing({"pbvs": [log]})
    ticks = with_timing(result, times)["runs"]["pbvs"]["tick_us"]
    assert (ticks["median"], ticks["max"]) == pytest.approx((100.0, 1000.0))
    assert "tick_us" not in result["runs"]["pbvs"]

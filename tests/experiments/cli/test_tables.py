"""Numbers on a terminal are whole however narrow it is; what a law has learnt is said in lines."""

import io

import pytest
from rich.console import Console

from experiments.cli.tables import learnt_lines, print_summary, slowed_line


def shown(width: int, law: str, laps: int) -> str:
    """The summary of a run on a terminal of that many characters."""
    errors = {f"{kind}_{unit}": 3 * [12.345] for kind in ("max", "static") for unit in ("mm", "deg")}
    run = {
        "true": errors,
        "measured": errors,
        "laps": [{"max_norm_mm": 67.891, "max_angle_deg": 67.891}] * laps,
        "guard": {"position_limit": 246810, "joint_step": 246810},
    }
    console = Console(width=width, file=io.StringIO(), record=True)
    print_summary(console, {"scenario": "everything", "runs": {law: run}})
    return console.export_text()


@pytest.mark.parametrize("width", [20, 80, 200])
def test_no_number_is_cut_off(width: int):
    text = shown(width, "self_calibrating", laps=9)
    assert "…" not in text
    assert text.count("12.345") == 2 * 12
    assert text.count("67.891") == 9 * 2
    assert text.count("246810") == 2


def test_eighty_characters_are_enough_for_the_errors_of_the_law_with_the_longest_name():
    assert shown(80, "disturbance_observer", laps=2).count("Disturbance observer") == 6


def test_a_path_that_took_longer_than_planned_is_said_to_have_and_another_one_is_not():
    laps = [{"times_planned": 1.5}, {"times_planned": 1.0}]
    said = slowed_line({"times_planned": 1.25, "laps": laps})
    assert said == "the path took 1.250 times as long as planned (laps: 1.500, 1.000)"
    assert (
        slowed_line({"times_planned": 1.001}) == slowed_line({"times_planned": None}) == slowed_line({}) == ""
    )


def test_events_and_what_the_path_needs_are_said_in_units_of_the_trade():
    standing = {
        "tip_sigma_m": 1e-3,
        "time_s": 5.25,
        "parameter": "p_alpha0",
        "parameter_sigma": 0.0087266,
        "unit": "rad",
    }
    learnt = {
        "path": {"before": standing, "now": {**standing, "tip_sigma_m": 4e-6}},
        "events": [
            {"time_s": 6.02, "kind": "tool displaced", "size": 4.9e-4, "unit": "m"},
            {"time_s": 7.0, "kind": "dead time changed", "size": 0.03, "unit": "s"},
        ],
    }
    path, *events = learnt_lines(learnt)
    assert "2.000 mm" in path
    assert "5.2 s" in path
    assert "p_alpha0, which may be off by 1 °" in path
    assert "0.008 mm" in path
    assert events == ["6.02 s: tool displaced, 0.49 mm", "7.00 s: dead time changed, 30 ms"]


def test_a_law_that_learns_nothing_has_nothing_to_say():
    assert learnt_lines({}) == []

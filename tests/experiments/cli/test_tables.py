"""What a law has learnt, in lines that people read."""

from experiments.cli.tables import learnt_lines


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

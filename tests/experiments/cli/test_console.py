"""How long a command takes is said once, early, and from its own speed on this machine."""

import pytest

from experiments.cli.console import Expected, duration


@pytest.mark.parametrize("whole", [30.0, 600.0, 7200.0])
def test_steady_progress_is_foretold_after_two_seconds_and_once(whole: float):
    expected, compiling = Expected(), 11.0  # s before the first progress
    said = [
        (t, found)
        for t in (0.25 * k for k in range(200))
        if (found := expected.seconds(t / whole, compiling + t)) is not None
    ]
    assert len(said) == 1
    when, found = said[0]
    assert when <= 2.5
    assert found == pytest.approx(whole)


def test_what_ends_before_that_or_does_not_move_is_not_foretold():
    assert [Expected().seconds(1.0, t) for t in (0.0, 5.0)] == [None, None]
    stuck = Expected()
    assert [stuck.seconds(0.1, float(t)) for t in range(60)] == [None] * 60


@pytest.mark.parametrize(
    ("seconds", "text"), [(38.0, "40 s"), (95.0, "100 s"), (180.0, "3 min"), (9000.0, "2.5 h")]
)
def test_a_time_is_said_as_one_would(seconds: float, text: str):
    assert duration(seconds) == text

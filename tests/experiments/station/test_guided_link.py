"""What the terminal says of the connection after a guided run."""

import io
from typing import Any

import pytest
from rich.console import Console

from experiments.station.guided_command import print_link

STOP, ON = "stopped_for_people", "goes_on"


def printed(events: list[list[Any]]) -> str:
    """The line of a run with these events."""
    run = {
        "turn_around_ms": {"median": 0.2, "99%": 0.5, "largest": 1.0},
        "controller": {},
        "camera": {},
        "pauses_s": [],
        "ended": "path",
        "events": events,
    }
    out = io.StringIO()
    print_link(Console(file=out, width=200), {"runs": {"pbvs": [run]}, "cell": None})
    return out.getvalue()


@pytest.mark.parametrize(
    ("events", "said"),
    [
        ([[1.0, STOP, "near"], [5.5, ON, "far"]], "largest 1.00); stopped for people 1 time, for 4.5 s\n"),
        (
            [[1.0, STOP, ""], [2.0, "acknowledged", ""], [2.0, ON, ""], [4.0, STOP, ""]],
            "; stopped for people 2 times, for 1.0 s, and then until the end\n",
        ),
        ([[1.0, "clock_step", "0.1 s"]], "largest 1.00)\n"),
    ],
)
def test_stops_for_people_are_told_with_how_long_the_robot_stood(events: list[list[Any]], said: str):
    assert printed(events).endswith(said)

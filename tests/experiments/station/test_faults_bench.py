"""A process of the cell that dies: the robot stops smoothly, and the record opens."""

from pathlib import Path

import pytest

from experiments.bench.faults import run_case

pytestmark = pytest.mark.real_time


@pytest.mark.slow
@pytest.mark.parametrize(
    ("who", "what", "then", "ended"),
    [
        ("client", "kill", "end", "-9"),
        ("camera", "kill", "end", ""),
    ],
)
def test_the_robot_is_never_surprised(tmp_path: Path, who: str, what: str, then: str, ended: str):
    outcome = run_case(tmp_path, who, what, then)
    assert outcome.ended.startswith(ended), outcome
    assert outcome.recorded > 1.5
    assert outcome.at_rest
    assert max(outcome.commands) < 1.0 + 1e-6
    assert outcome.links[0] < 1.0
    # Commands have no limit of jerk, and a spring without damping swings to twice a step of acceleration.
    assert outcome.links[1] < 2.0

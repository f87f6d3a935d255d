"""Cells in which much differs from belief at once, each of which one thing led the law astray."""

import numpy as np
import pytest

from diagrams.runs.simulation import Experiment
from experiments.metrics.run_metrics import pose_errors
from experiments.robustness.contenders import contenders
from experiments.robustness.mixed import mixture
from experiments.robustness.study import Case, Trial


def advanced(seed: int, path: str, until: float) -> Experiment:
    """The mixture that a seed draws, until a time in s."""
    (law,) = contenders("self_calibrating")
    scenario = Trial("everything", Case("mixed", draw=mixture), law, seed, path, laps=1).load()
    experiment = Experiment(scenario, law.law)
    experiment.advance(until=until)
    return experiment


@pytest.mark.slow
def test_drives_with_other_poles_are_found_after_a_dead_time_that_nobody_knew():
    """A PUMA 560 over EGM, 60 ms late: what that leaves to be seen of the gains decides by a small margin."""
    experiment = advanced(1402, "rectangle", until=4.5)
    learnt = experiment.log().learnt
    assert learnt is not None
    assert [event["kind"] for event in learnt["events"]] == ["drive gains unlike belief"]
    # The drives give way 25/40 * 100/60 * 10/5 times as far; at what is shown least, a seventh more.
    assert learnt["events"][0]["size"] == pytest.approx(2.08, rel=0.25)


@pytest.mark.slow
def test_friction_that_seemed_to_stick_is_found_not_to_while_its_motor_moves_about_its_plan():
    """A KR 16 over EGM, whose wrist has ten times the friction of others: it turned by 0.24 degrees."""
    log = advanced(1405, "figure_eight", until=8.0).log()
    on_path = pose_errors(log, "true")[log.time >= log.path_start]
    assert len(on_path) > 100
    assert np.degrees(np.linalg.norm(on_path[:, :3], axis=1)).max() < 0.05

"""A path that is slowed, held and resumed: later everywhere, nowhere left, and the guard never acts."""

import numpy as np
import pytest

from diagrams.runs import simulation
from diagrams.runs.simulation import Experiment, run
from robots.pose import pose_error
from systems.servo.open_loop import OpenLoop
from tests.diagrams.rigs import scenario

QUICK = [
    "reference.path=!Circle {radius_mm: 60}",
    "reference.acceleration=1",
    "reference.settle=1.5",
    "reference.dwell=0.5",
]
HELD = "reference.override=[{at: 2.5, share: 0.0}, {at: 4.0, share: 1.0}]"


class Cautious(OpenLoop):
    """Asks for half the speed from the first tick on."""

    share = 0.5

    def __init__(self, *given) -> None:
        super().__init__(*given)
        self.DeclareStateOutputPort("speed_share", self.DeclareDiscreteState([self.share]))


def largest(log) -> float:
    error = pose_error(log.X_WE_desired, log.X_WE_true)[log.time >= log.path_start]
    return float(np.linalg.norm(error[:, 3:], axis=1).max())


@pytest.fixture(scope="module")
def logs():
    return [run(scenario("misaligned", *changes), "numerical_ik") for changes in (QUICK, [*QUICK, HELD])]


def test_a_held_path_is_late_by_the_pause_and_as_accurate(logs):
    as_planned, held = logs
    # Smooth steps of 0.5 s down and up, 1.5 s apart: as late as with jumps.
    assert held.path_end == pytest.approx(as_planned.path_end + 1.5)
    assert held.time[-1] == pytest.approx(held.path_end, abs=0.009)
    assert held.dwell_start == pytest.approx(as_planned.dwell_start + 1.5, abs=0.005)
    assert largest(held) < 1.02 * largest(as_planned)
    pause = (held.time > 3.1) & (held.time < 3.9)
    assert np.ptp(held.X_WE_desired[pause], axis=0).max() == 0.0
    assert not any(held.guard_counts.values())
    np.testing.assert_allclose(held.X_WE_desired[-1], as_planned.X_WE_desired[-1], atol=1e-12)


@pytest.mark.slow
def test_a_law_may_slow_the_path():
    experiment = Experiment(scenario("nominal", *QUICK), Cautious)
    experiment.advance()
    log = experiment.log()
    planned = experiment.path
    # Full speed until the step begins, which is half over after 0.25 s.
    assert log.dwell_start == pytest.approx(0.25 + 2.0 * (planned.dwell_start - 0.25), abs=0.02)
    fastest = np.abs(np.diff(log.X_WE_desired[:, :3, 3], axis=0)).max() / 0.004
    as_planned = np.abs(planned.sample(log.time)[1][:, 3:]).max()
    assert fastest == pytest.approx(0.5 * as_planned, rel=1e-3)


class Halting(Cautious):
    """Asks for no speed at all."""

    share = 0.0


@pytest.mark.slow
def test_a_path_that_is_held_for_long_ends_the_run_with_an_event(monkeypatch):
    monkeypatch.setattr(simulation, "_LONGEST_HOLD", 1.0)
    experiment = Experiment(scenario("nominal", *QUICK, "station.elasticity=rigid"), Halting)
    experiment.advance()
    log = experiment.log()
    assert [event.detail for event in log.guard_events if event.kind == "path_held"] == [
        f"the path did not go on for 1 s: the run ends {log.path_end - log.time[-1]:.1f} s short of it"
    ]


def test_a_feedforward_that_is_computed_beforehand_refuses_a_slowed_path():
    changes = [HELD, "servo.feedforward.kind=stable", "reference.timing=polynomial"]
    with pytest.raises(ValueError, match=r"stable.*planned speed"):
        Experiment(scenario("nominal", *changes), "open_loop")

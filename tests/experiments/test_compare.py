"""Runs in parallel processes: the same as one by one, and nothing left behind when one fails."""

import multiprocessing
import os
from dataclasses import replace

import numpy as np
import pytest

from diagrams.runs.simulation import run
from diagrams.scenario.scenario import load_scenario
from experiments.cli.prepare import quick
from experiments.cli.workers import LocalProcesses, SimulationError
from experiments.comparison.compare import compare
from robots.description.model import load_robot
from tests.experiments.commands import SHORT

SETTINGS = [setting.removeprefix("--set=") for setting in SHORT]
ARRAYS = ("X_WE_true", "X_WE_measured", "joint_effort", "position_command", "correction")


def same(a, b) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True) for name in ARRAYS)


@pytest.fixture(scope="module")
def scenario():
    return load_scenario("misaligned", [*SETTINGS, "seed=5"])


@pytest.mark.slow
def test_a_cycle_is_a_run_with_its_own_seed_bit_for_bit(scenario):
    robot, shares, environment = load_robot("irb1200"), [], dict(os.environ)
    logs = compare(
        scenario,
        robot,
        ["numerical_ik", "open_loop"],
        cycles=2,
        executor=LocalProcesses(2),
        progress=shares.append,
    )
    assert list(logs) == ["numerical_ik", "open_loop"]
    for cycle, log in enumerate(logs["numerical_ik"]):
        assert (log.law, log.seed) == ("numerical_ik", 5 + cycle)
        assert same(log, run(scenario, "numerical_ik", robot, seed=5 + cycle))
    assert not same(*logs["numerical_ik"])
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert dict(os.environ) == environment


@pytest.mark.slow
def test_a_run_that_breaks_off_ends_the_comparison_and_its_processes(scenario):
    broken = replace(scenario, integrator=replace(scenario.integrator, scheme="magic"))
    with pytest.raises(SimulationError, match=r"law open_loop, seed 5: .*magic"):
        compare(broken, load_robot("irb1200"), ["open_loop"], executor=LocalProcesses(1))
    assert multiprocessing.active_children() == []


@pytest.mark.slow
def test_an_interruption_ends_all_processes_at_once(scenario):
    long = replace(scenario, reference=replace(scenario.reference, dwell=60.0))

    def interrupt(share: float) -> None:
        if share > 0.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        compare(
            long,
            load_robot("irb1200"),
            ["open_loop"],
            cycles=3,
            executor=LocalProcesses(2),
            progress=interrupt,
        )
    assert multiprocessing.active_children() == []


def test_quick_leaves_alone_what_is_set_explicitly():
    scenario = load_scenario("misaligned")
    fast, note = quick(scenario)
    assert fast.reference.acceleration == pytest.approx(4.0 * scenario.reference.acceleration)
    assert fast.reference.settle == 2.0
    assert note == "one cycle, acceleration 2.8 1/s^2, settling 2 s"
    same_path, note = quick(scenario, ["reference.acceleration=0.7", "reference.settle=4"])
    assert same_path.reference == scenario.reference
    assert note == "one cycle"

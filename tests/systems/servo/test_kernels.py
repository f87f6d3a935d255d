"""Compiled functions of laws and guard: no tick waits for the compiler."""

import pytest

from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario
from robots.kinematics import kernels as of_kinematics
from systems.guard import kernels as of_guard
from systems.servo.kernels import steps as kernels


def compiled() -> dict[str, int]:
    """How often every function has been compiled, once for each kind of arguments."""
    functions = vars(of_kinematics) | vars(of_guard) | vars(kernels)
    return {name: len(f.signatures) for name, f in functions.items() if hasattr(f, "signatures")}


@pytest.mark.parametrize("law", ["open_loop", "numerical_ik", "pbvs", "position_level", "compensation"])
def test_everything_is_compiled_before_the_first_tick(law: str):
    experiment = Experiment(load_scenario("nominal"), law)
    before = compiled()
    assert before
    experiment.advance(0.02)
    assert compiled() == before

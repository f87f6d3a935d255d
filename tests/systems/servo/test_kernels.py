"""Compiled functions of laws and guard: no tick waits for the compiler."""

import subprocess
import sys

import numpy as np
import pytest

from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario
from robots.kinematics import kernels as of_kinematics
from robots.pose import euler_difference, euler_rate_matrix, rotation_from_zyx, zyx_from_rotation
from systems.guard import kernels as of_guard
from systems.servo.kernels import parts, steps


def compiled() -> dict[str, int]:
    """How often every function has been compiled, once for each kind of arguments."""
    functions = vars(of_kinematics) | vars(of_guard) | vars(parts) | vars(steps)
    return {name: len(f.signatures) for name, f in functions.items() if hasattr(f, "signatures")}


@pytest.mark.parametrize("law", ["open_loop", "numerical_ik", "pbvs", "position_level", "compensation"])
def test_everything_is_compiled_before_the_first_tick(law: str):
    experiment = Experiment(load_scenario("nominal"), law)
    before = compiled()
    assert before
    experiment.advance(0.02)
    assert compiled() == before


_UNTIL_ON_THE_PATH = """
import sys
from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario

def compiled():
    modules = {name: vars(each) for name, each in sys.modules.items() if name.startswith("systems.")}
    found = {(module, name): f for module, every in modules.items() for name, f in every.items()}
    functions = {name: f for name, f in found.items() if hasattr(f, "signatures")}
    return {name: len(f.signatures) for name, f in functions.items()}

experiment = Experiment(load_scenario(sys.argv[1]), "self_calibrating")
before = compiled()
experiment.advance(until=5.0)
later = [name for name, count in compiled().items() if before.get(name) != count]
assert len(before) > 50
assert not later, later
"""


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["everything", "everything-realistic"])
def test_all_of_the_self_calibrating_law_is_compiled_before_the_first_tick(scenario: str):
    """In a process of its own, in which nothing else has been: from start and probe onto the path."""
    command = [sys.executable, "-c", _UNTIL_ON_THE_PATH, scenario]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_how_close_a_jacobian_is_to_a_singularity_goes_by_its_smallest_singular_value():
    """With five other values of any size, on both sides of the bound."""
    rng = np.random.default_rng(0)
    for smallest in parts.NEARLY_SINGULAR * np.array([0.0, 0.3, 0.999, 1.001, 3.0]):
        for _ in range(50):
            U, _, Vt = np.linalg.svd(rng.normal(size=(6, 6)))
            J = U @ np.diag([*(smallest + rng.exponential(size=5)), smallest]) @ Vt
            wanted = max(0.0, 1.0 - smallest / parts.NEARLY_SINGULAR)
            assert abs(parts.closeness(J) - wanted) < 1e-12


def test_feedback_in_euler_angles_is_the_rate_matrix_times_wrapped_differences():
    rng = np.random.default_rng(1)
    for _ in range(200):
        wanted, seen = (
            np.column_stack([rotation_from_zyx(rng.uniform(-np.pi, np.pi, 3)), rng.normal(size=3)])
            for _ in range(2)
        )
        zyx = zyx_from_rotation(seen[:, :3])
        difference = euler_difference(zyx_from_rotation(wanted[:, :3]).tolist(), zyx.tolist())
        turned = euler_rate_matrix(zyx) @ difference
        twist = np.concatenate([2.0 * turned, 3.0 * (wanted[:, 3] - seen[:, 3])])
        np.testing.assert_allclose(parts.euler_feedback(wanted, seen, (2.0, 3.0)), twist, atol=1e-12)

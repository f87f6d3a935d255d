"""Who waits for numba: who makes a law that needs it, and no tick; and compiled errors of poses."""

import importlib
import pkgutil

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario
from robots.pose import pose_error
from systems.estimation import kernels
from systems.estimation.kernels.poses import pose_errors


def compiled() -> dict[str, int]:
    """How often every function has been compiled, once for each kind of arguments."""
    modules = [
        importlib.import_module(f"{kernels.__name__}.{m.name}")
        for m in pkgutil.iter_modules(kernels.__path__)
    ]
    functions = {f"{m.__name__}.{name}": f for m in modules for name, f in vars(m).items()}
    return {name: len(f.signatures) for name, f in functions.items() if hasattr(f, "signatures")}


@pytest.mark.slow
@pytest.mark.parametrize("interface", ["direct", "egm"])
def test_everything_is_compiled_before_the_first_tick(interface):
    scenario = load_scenario("everything-realistic", [f"station.interface={interface}"])
    experiment = Experiment(scenario, "self_calibrating")
    before = compiled()
    assert before
    experiment.advance(0.7)
    assert compiled() == before


def poses(rotations: Rotation, seed: int) -> np.ndarray:
    X = np.tile(np.eye(4), (len(rotations), 1, 1))
    X[:, :3, :3], X[:, :3, 3] = rotations.as_matrix(), np.random.default_rng(seed).normal(size=(len(X), 3))
    return X


# Near half a turn the sine does not show the axis; at half a turn either of the two axes is right.
@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, 1.6, 3.0, np.pi - 9e-3, np.pi - 1e-4])
def test_errors_are_those_of_one_pair_after_the_other(angle):
    axes = np.random.default_rng(1).normal(size=(50, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    here = Rotation.random(50, rng=np.random.default_rng(2))
    X_WE, X_WD = poses(here, 3), poses(Rotation.from_rotvec(angle * axes) * here, 4)
    np.testing.assert_allclose(pose_errors(X_WD, X_WE), pose_error(X_WD, X_WE), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(pose_errors(X_WD, X_WE)[:, :3], angle * axes, atol=1e-7)

"""Who waits for numba: who makes a law that needs it, and neither other commands nor a tick."""

import importlib
import pkgutil

from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario
from systems.estimation import kernels


def compiled() -> dict[str, int]:
    """How often every function has been compiled, once for each kind of arguments."""
    modules = [
        importlib.import_module(f"{kernels.__name__}.{m.name}")
        for m in pkgutil.iter_modules(kernels.__path__)
    ]
    functions = {f"{m.__name__}.{name}": f for m in modules for name, f in vars(m).items()}
    return {name: len(f.signatures) for name, f in functions.items() if hasattr(f, "signatures")}


def test_everything_is_compiled_before_the_first_tick():
    experiment = Experiment(load_scenario("everything-realistic"), "self_calibrating")
    before = compiled()
    assert before
    experiment.advance(0.7)
    assert compiled() == before

"""Benchmark of the self-calibrating law: what its ticks cost, and how long a first process waits.

``python -m experiments.bench.learning`` prints these rows alone.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator

import numpy as np

from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario

LAW, SPAN, FIRST_TICKS = "self_calibrating", 8.0, 10  # s of the scenario: probing, then four on the path
ALLOWED = {0.5: 500.0, 0.99: 1000.0, 0.999: 1000.0, 1.0: 2000.0}  # us, by the share of ticks that keep to it
ALLOWED_START = 10.0  # s of CPU
_MAKE = f"""
from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario
Experiment(load_scenario("everything"), "{LAW}")
"""

Row = tuple[str, str, float, str, float, str]  # name, what it is, value, unit, yardstick, what that is


def learning() -> Iterator[Row]:
    """Benchmarks of a law that learns."""
    for scenario in ("everything", "everything-realistic"):
        experiment = Experiment(load_scenario(scenario), LAW)
        experiment.advance(SPAN)
        ticks = 1e6 * experiment.servo.tick_clock.seconds[FIRST_TICKS:]
        for share, allowed in ALLOWED.items():
            name, text = (
                f"learning_tick_{scenario}_{share:g}",
                f"{scenario}, {100.0 * share:g} % of ticks below",
            )
            yield name, text, float(np.quantile(ticks, share)), "us", allowed, "allowed"
    with tempfile.TemporaryDirectory() as cache:
        first, again = start_time(cache), start_time(cache)
    text = f"{LAW}, what the first process compiles"
    yield "learning_compile", text, first - again, "s", ALLOWED_START, "allowed"


def start_time(cache: str) -> float:
    """CPU time in s of a process that makes the law, with what is in a folder compiled already."""
    env = os.environ | {"NUMBA_CACHE_DIR": cache}
    before = os.times()
    subprocess.run([sys.executable, "-c", _MAKE], env=env, check=True)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system

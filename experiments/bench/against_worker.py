"""One of two commits under measurement: builds and advances what it is told, line by line of JSON.

Run as a file on the path of either commit, so it looks for what it needs where older commits had it, too.
"""

import importlib
import json
import sys
import time
from typing import Any

import numpy as np

_PLACES = {
    "Experiment": ("diagrams.runs.simulation", "diagrams.run"),
    "load_scenario": ("diagrams.scenario.scenario", "diagrams.scenario.scenario_file", "diagrams.scenario"),
    "load_robot": ("robots.description.model", "robots.model"),
    "BarePlant": ("experiments.bench.bare",),
}


def find(name: str) -> Any:
    """A class or function by its name.

    Raises:
        ImportError: if this commit has it in none of the known places.
    """
    for place in _PLACES[name]:
        try:
            return getattr(importlib.import_module(place), name)
        except (ImportError, AttributeError):
            continue
    raise ImportError(f"this commit has {name} in none of {', '.join(_PLACES[name])}")


class Worker:
    """Experiments and bare plants by name, advanced slice by slice."""

    def __init__(self) -> None:
        self._running: dict[str, Any] = {}

    def closed(self, name: str, law: str, settings: list[str]) -> None:
        """Builds a closed loop."""
        scenario = find("load_scenario")("misaligned", settings)
        self._running[name] = find("Experiment")(scenario, law, find("load_robot")(scenario.robot))

    def bare(self, name: str, closed: str, law: str, settings: list[str]) -> None:
        """Builds a bare plant that moves as a closed loop has moved so far."""
        scenario = find("load_scenario")("misaligned", settings)
        robot = find("load_robot")(scenario.robot)
        experiment = find("Experiment")(scenario, law, robot)
        self._running[name] = find("BarePlant")(experiment, robot, self._running[closed].log())

    def advance(self, name: str, until: float) -> dict[str, float]:
        """Advances to a time in s and says what that took in s."""
        cpu, wall = time.process_time(), time.perf_counter()
        self._running[name].advance(until)
        return {"cpu": time.process_time() - cpu, "wall": time.perf_counter() - wall}

    def save(self, name: str, path: str) -> None:
        """Writes the true tips (n, 3) in m of a closed loop."""
        np.save(path, self._running[name].log().X_WE_true[:, :3, 3])

    def scheme(self, name: str) -> str:
        """Which integration scheme a closed loop has."""
        return self._running[name].integration.scheme

    def drop(self, name: str) -> None:
        """Forgets one."""
        del self._running[name]


def main() -> None:
    """Answers until the input ends."""
    worker, answers = Worker(), sys.stdout
    sys.stdout = sys.stderr  # whatever else is printed is no answer
    for line in sys.stdin:
        request = json.loads(line)
        answer = getattr(worker, request.pop("do"))(**request)
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()

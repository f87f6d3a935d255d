"""The one configuration of an experiment, read from YAML and checked before anything is built."""

import math
from dataclasses import dataclass, field, fields, is_dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.common.yaml import yaml_dump, yaml_load, yaml_load_typed
from pydrake.systems.analysis import GetIntegrationSchemes

from robots.geometric_errors import GeometricErrors
from robots.model import NUM_JOINTS
from robots.plant import ELASTICITIES
from systems.camera import CameraConfig
from systems.drive import KINDS, DriveConfig
from systems.guard import GuardConfig
from systems.paths import ReferenceConfig
from systems.servo import LAWS, LawConfig


class ScenarioError(ValueError):
    """A scenario is missing, cannot be read, or asks for something impossible."""


@dataclass
class StationConfig:
    """The robot cell: what the controller does not see, and what it is connected to."""

    kind: str = "simulated"
    period: float = 4e-3  # s, between two commands and between two joint samples
    elasticity: str = "joints"  # of the true robot: rigid or joints
    payload: float = 0.0  # kg at the flange
    errors: GeometricErrors = field(default_factory=GeometricErrors)
    drive: DriveConfig = field(default_factory=DriveConfig)
    camera: CameraConfig = field(default_factory=CameraConfig)


@dataclass
class ServoConfig:
    """The controller: gains of each law, and the guard."""

    laws: dict[str, LawConfig] = field(default_factory=dict)
    guard: GuardConfig = field(default_factory=GuardConfig)


@dataclass
class IntegratorConfig:
    """How the plant is integrated.

    ``auto`` is runge_kutta3, or radau3 where that one would need tiny steps. What is left open is chosen such
    that the tip is right to less than a micrometre, as the bench shows.
    """

    scheme: str = "auto"  # or any name of Drake's GetIntegrationSchemes
    accuracy: float | None = None
    max_step: float | None = None  # s


@dataclass
class Scenario:
    """Everything that an experiment needs to know."""

    description: str = ""
    robot: str = "irb1200"  # a shipped robot or the path of a robot file
    law: str = "numerical_ik"  # the law that `truetip run` runs
    seed: int = 0  # of the camera's noise
    home_deg: np.ndarray = field(default_factory=lambda: np.zeros(NUM_JOINTS))  # the branch nearest to it is used
    initial_error_mm: np.ndarray = field(default_factory=lambda: np.zeros(3))  # the tip starts so far off
    station: StationConfig = field(default_factory=StationConfig)
    reference: ReferenceConfig = field(default_factory=ReferenceConfig)
    servo: ServoConfig = field(default_factory=ServoConfig)
    integrator: IntegratorConfig = field(default_factory=IntegratorConfig)


# Where a number is allowed to lie; a delay of 4 means milliseconds written as seconds.
_RANGES: dict[str, tuple[float, float, str]] = {
    "station.period": (5e-4, 0.1, "s"),
    "station.payload": (0.0, 1000.0, "kg"),
    "station.drive.command_delay": (0.0, 1.0, "s"),
    "station.drive.dead_time": (0.0, 1.0, "s"),
    "station.camera.period": (5e-4, 1.0, "s"),
    "station.camera.delay": (0.0, 1.0, "s"),
    "station.camera.position_sigma": (0.0, 0.02, "m"),
    "station.camera.orientation_sigma_deg": (0.0, 10.0, "deg"),
    "reference.acceleration": (1e-3, 100.0, "1/s^2"),
    "reference.settle": (0.0, 600.0, "s"),
    "reference.dwell": (0.0, 600.0, "s"),
    "reference.preview": (0.0, 1.0, "s"),
    "servo.guard.hold_after": (1e-3, 10.0, "s"),
    "servo.guard.stop_after": (1e-3, 60.0, "s"),
    "servo.guard.stop_time": (1e-3, 10.0, "s"),
    "servo.guard.largest_deviation": (1e-4, 2.0, "m"),
    "servo.guard.largest_deviation_deg": (0.01, 180.0, "deg"),
}
_LAW_RANGES: dict[str, tuple[float, float, str]] = {
    "translation": (1e-3, 1000.0, "1/s"),
    "rotation": (1e-3, 1000.0, "1/s"),
    "correction_limit": (1e-4, 2.0, "m"),
    "correction_limit_deg": (0.01, 180.0, "deg"),
    "correction_speed_limit_deg_s": (0.01, 1000.0, "deg/s"),
}


def shipped_scenarios() -> list[str]:
    """The names of the scenarios that come with the package."""
    return sorted(entry.name.removesuffix(".yaml") for entry in _folder().iterdir() if entry.name.endswith(".yaml"))


def load_scenario(name: str, settings: list[str] | None = None) -> Scenario:
    """Reads a shipped scenario by name or any scenario file by its path.

    A file may begin with ``extends: NAME``, a shipped scenario or a path relative to the file, and then
    says only what is different.

    Args:
        name: a shipped scenario (``"misaligned"``) or the path of a YAML file.
        settings: changes such as ``"station.camera.delay=0.008"``; the value is read as YAML.

    Raises:
        ScenarioError: if something is missing, unknown, out of range or not readable; one line that
            says what and where.
    """
    tree = _read(name, Path())
    for setting in settings or []:
        _apply(tree, setting)
    tree = _with_numbers(tree, Scenario())
    problem = _misfit(tree, Scenario())
    if problem:
        raise ScenarioError(f"scenario {name}: {problem}")
    try:
        scenario = yaml_load_typed(schema=Scenario, data=yaml_dump(tree))
    except Exception as error:  # the parser raises a dozen types, all of them about this file
        raise ScenarioError(f"scenario {name}: {_one_line(error)}") from error
    _check(scenario, name)
    return scenario


def scenario_text(scenario: Scenario) -> str:
    """The whole scenario as YAML that `load_scenario` reads back."""
    return yaml_dump(_plain(scenario))


def _folder():
    return files("diagrams") / "scenarios"


def _read(name: str, beside: Path, depth: int = 0) -> dict:
    if name.endswith((".yaml", ".yml")):
        path = beside / name
    else:
        path = Path(str(_folder() / f"{name}.yaml"))
    if not path.is_file():
        raise ScenarioError(
            f"scenario '{name}': no file {path}; give the path of a YAML file or one of {', '.join(shipped_scenarios())}"
        )
    if depth > 8:
        raise ScenarioError(f"scenario {path}: 'extends' runs in a circle")
    try:
        tree = yaml_load(filename=str(path))
    except Exception as error:  # as above
        raise ScenarioError(f"scenario {path}: {_one_line(error)}") from error
    if not isinstance(tree, dict):
        raise ScenarioError(f"scenario {path}: must be a mapping of keys to values")
    base = tree.pop("extends", None)
    return _merged(_read(str(base), path.parent, depth + 1), tree) if base else tree


def _merged(base: dict, change: dict) -> dict:
    result = dict(base)
    for key, value in change.items():
        both = isinstance(value, dict) and isinstance(result.get(key), dict)
        result[key] = _merged(result[key], value) if both else value
    return result


def _apply(tree: dict, setting: str) -> None:
    key, separator, value = setting.partition("=")
    if not separator or not key:
        raise ScenarioError(f"--set {setting}: must look like station.camera.delay=0.008")
    parts = key.strip().split(".")
    for part in parts[:-1]:
        tree = tree.setdefault(part, {})
        if not isinstance(tree, dict):
            raise ScenarioError(f"--set {setting}: '{part}' is a value, not a group")
    try:
        tree[parts[-1]] = yaml_load(data=f"value: {value}")["value"]
    except Exception as error:  # as above
        raise ScenarioError(f"--set {setting}: {_one_line(error)}") from error


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _misfit(value: Any, default: Any, where: str = "") -> str:
    """The first thing in a tree that does not fit the field it is for, or an empty string."""
    if is_dataclass(default):
        if not isinstance(value, dict):
            return f"{where} must be a group of {', '.join(entry.name for entry in fields(default))}, got {value!r}"
        known = {entry.name: getattr(default, entry.name) for entry in fields(default)}
        for key, entry in value.items():
            path = f"{where}.{key}" if where else str(key)
            problem = (
                _misfit(entry, known[key], path)
                if key in known
                else f"unknown key '{path}'; known here: {', '.join(known)}"
            )
            if problem:
                return problem
        return ""
    if isinstance(default, dict):
        if not isinstance(value, dict):
            return f"{where} must be a group, got {value!r}"
        return next(filter(None, (_misfit(entry, LawConfig(), f"{where}.{key}") for key, entry in value.items())), "")
    if isinstance(default, np.ndarray):
        fits = isinstance(value, list) and len(value) == default.size and all(map(_is_number, value))
        return "" if fits else f"{where} must be {default.size} numbers, got {value!r}"
    if isinstance(default, int):
        return "" if isinstance(value, int) else f"{where} must be a whole number, got {value!r}"
    if isinstance(default, float) or default is None:
        fits = _is_number(value) or (default is None and value is None)
        return "" if fits else f"{where} must be a number, got {value!r}"
    return ""


def _with_numbers(value: Any, default: Any) -> Any:
    """The tree with texts such as 50e-6 turned to numbers where one is wanted; YAML asks for 50.0e-6."""
    if isinstance(value, dict):
        known = vars(default) if is_dataclass(default) else {}
        return {
            key: _with_numbers(entry, known.get(key, LawConfig() if isinstance(default, dict) else None))
            for key, entry in value.items()
        }
    if isinstance(value, list) and isinstance(default, np.ndarray):
        return [_with_numbers(entry, 0.0) for entry in value]
    if isinstance(value, str) and not isinstance(default, str):
        try:
            return float(value)
        except ValueError:
            return value
    return value


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _lookup(scenario: Any, path: str) -> Any:
    for part in path.split("."):
        scenario = getattr(scenario, part)
    return scenario


def _check(scenario: Scenario, name: str) -> None:
    def refuse(message: str) -> None:
        raise ScenarioError(f"scenario {name}: {message}")

    def in_range(path: str, value: float, bounds: tuple[float, float, str]) -> None:
        low, high, unit = bounds
        if not (math.isfinite(value) and low <= value <= high):
            refuse(f"{path} must be between {low:g} and {high:g} {unit}, got {value:g}")

    for path, bounds in _RANGES.items():
        in_range(path, _lookup(scenario, path), bounds)
    for law, config in scenario.servo.laws.items():
        if law not in LAWS:
            refuse(f"servo.laws.{law}: no such law; there are {', '.join(LAWS)}")
        if config.drive not in KINDS:
            refuse(f"servo.laws.{law}.drive must be one of {', '.join(KINDS)}, got '{config.drive}'")
        for label, bounds in _LAW_RANGES.items():
            in_range(f"servo.laws.{law}.{label}", getattr(config, label), bounds)
    integrator = scenario.integrator
    if integrator.scheme != "auto" and integrator.scheme not in GetIntegrationSchemes():
        refuse(
            f"integrator.scheme must be auto or one of {', '.join(GetIntegrationSchemes())}, got '{integrator.scheme}'"
        )
    if integrator.accuracy is not None:
        in_range("integrator.accuracy", integrator.accuracy, (1e-12, 1e-1, "relative"))
    if integrator.max_step is not None:
        in_range("integrator.max_step", integrator.max_step, (1e-6, 0.1, "s"))
    if scenario.law not in LAWS:
        refuse(f"law must be one of {', '.join(LAWS)}, got '{scenario.law}'")
    if scenario.station.kind != "simulated":
        refuse(f"station.kind must be 'simulated', got '{scenario.station.kind}'")
    if scenario.station.elasticity not in ELASTICITIES:
        refuse(f"station.elasticity must be one of {', '.join(ELASTICITIES)}, got '{scenario.station.elasticity}'")


def _plain(value: Any) -> Any:
    """Dataclasses and arrays as mappings and lists, for a YAML text."""
    if is_dataclass(value):
        return {entry.name: _plain(getattr(value, entry.name)) for entry in fields(value)}
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(entry) for entry in value]
    return value.item() if isinstance(value, np.generic) else value

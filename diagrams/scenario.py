"""The one configuration of an experiment, read from YAML and checked before anything is built."""

import math
from collections.abc import Collection
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np
from pydrake.common.yaml import yaml_dump, yaml_load_typed
from pydrake.systems.analysis import GetIntegrationSchemes

from diagrams.integration import IntegratorConfig
from diagrams.scenario_file import ScenarioError, conformed, one_line, read_tree, shipped_scenarios
from robots.geometric_errors import GeometricErrors
from robots.model import NUM_JOINTS
from robots.plant import ELASTICITIES
from systems.camera import CameraConfig
from systems.drive import KINDS, DriveConfig
from systems.feedforward import FEEDFORWARDS, FeedforwardConfig
from systems.guard import GuardConfig
from systems.paths import ReferenceConfig
from systems.servo import LAWS, LawConfig

__all__ = ["Scenario", "ScenarioError", "load_scenario", "scenario_text", "shipped_scenarios"]


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

    laws: dict[str, LawConfig] = field(default_factory=lambda: {name: LawConfig() for name in LAWS})
    feedforward: FeedforwardConfig = field(default_factory=FeedforwardConfig)
    guard: GuardConfig = field(default_factory=GuardConfig)


@dataclass
class Scenario:
    """Everything that an experiment needs to know."""

    description: str = ""
    robot: str = "irb1200"  # a shipped robot or the path of a robot file
    law: str = "numerical_ik"  # the law that `truetip run` runs
    seed: int = 0  # of the camera's noise
    home_deg: np.ndarray = field(
        default_factory=lambda: np.zeros(NUM_JOINTS)
    )  # the branch nearest to it is used
    initial_error_mm: np.ndarray = field(default_factory=lambda: np.zeros(3))  # the tip starts so far off
    station: StationConfig = field(default_factory=StationConfig)
    reference: ReferenceConfig = field(default_factory=ReferenceConfig)
    servo: ServoConfig = field(default_factory=ServoConfig)
    integrator: IntegratorConfig = field(default_factory=IntegratorConfig)


# Where a number is allowed to lie; a delay of 4 means milliseconds written as seconds.
_RANGES: dict[str, tuple[float, float, str]] = {
    "seed": (0, 2**32 - 1, ""),
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
    "servo.feedforward.stiffness_error": (-0.9, 10.0, ""),
    "servo.feedforward.inertia_error": (-0.9, 10.0, ""),
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
    try:
        tree = conformed(read_tree(name, settings or []), Scenario())
        scenario = yaml_load_typed(schema=Scenario, data=yaml_dump(tree))
        _check(scenario)
    except ScenarioError as error:
        prefix = "" if str(error).startswith(("scenario", "--set")) else f"scenario {name}: "
        raise ScenarioError(f"{prefix}{error}") from error
    except Exception as error:  # the parser raises a dozen types, all of them about this file
        raise ScenarioError(f"scenario {name}: {one_line(error)}") from error
    return scenario


def scenario_text(scenario: Scenario) -> str:
    """The whole scenario as YAML that `load_scenario` reads back."""
    return str(yaml_dump(_plain(scenario)))


def _lookup(scenario: Any, path: str) -> Any:
    for part in path.split("."):
        scenario = getattr(scenario, part)
    return scenario


def _check(scenario: Scenario) -> None:
    """Refuses what cannot be. Raises ScenarioError."""
    for path, bounds in _RANGES.items():
        _in_range(path, _lookup(scenario, path), bounds)
    for law, config in scenario.servo.laws.items():
        _one_of(f"servo.laws.{law}.drive", config.drive, KINDS)
        for label, bounds in _LAW_RANGES.items():
            _in_range(f"servo.laws.{law}.{label}", getattr(config, label), bounds)
    _one_of("law", scenario.law, LAWS)
    _one_of("servo.feedforward.kind", scenario.servo.feedforward.kind, ("none", *FEEDFORWARDS))
    _one_of("station.kind", scenario.station.kind, ("simulated",))
    _one_of("station.elasticity", scenario.station.elasticity, ELASTICITIES)
    integrator = scenario.integrator
    _one_of("integrator.scheme", integrator.scheme, ("auto", *GetIntegrationSchemes()))
    if integrator.accuracy is not None:
        _in_range("integrator.accuracy", integrator.accuracy, (1e-12, 1e-1, "relative"))
    if integrator.max_step is not None:
        _in_range("integrator.max_step", integrator.max_step, (1e-6, 0.1, "s"))


def _in_range(path: str, value: float, bounds: tuple[float, float, str]) -> None:
    low, high, unit = bounds
    if not (math.isfinite(value) and low <= value <= high):
        raise ScenarioError(
            f"{path} must be between {low:.10g} and {high:.10g} {unit}".rstrip() + f", got {value:.10g}"
        )


def _one_of(path: str, value: str, allowed: Collection[str]) -> None:
    if value not in allowed:
        raise ScenarioError(f"{path} must be one of {', '.join(allowed)}, got '{value}'")


def _plain(value: Any) -> Any:
    """Dataclasses and arrays as mappings and lists, for a YAML text."""
    if is_dataclass(value):
        return {entry.name: _plain(getattr(value, entry.name)) for entry in fields(value)}
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(entry) for entry in value]
    return value.item() if isinstance(value, np.generic) else value

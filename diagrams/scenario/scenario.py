"""The one configuration of an experiment, read from YAML and checked before anything is built."""

import math
from collections.abc import Collection
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np
from pydrake.common.yaml import yaml_dump, yaml_load_typed
from pydrake.systems.analysis import GetIntegrationSchemes

from diagrams.integration import IntegratorConfig
from diagrams.scenario.scenario_file import ScenarioError, conformed, one_line, read_tree, shipped_scenarios
from robots.description.geometric_errors import GeometricErrors
from robots.description.model import NUM_JOINTS, Placement
from robots.dynamics.plant import ELASTICITIES
from systems.cell.drive import KINDS, DriveConfig
from systems.cell.encoders import EncoderConfig
from systems.cell.events.station_events import StationEvent
from systems.cell.marker_camera import MarkerCameraConfig
from systems.cell.network_faults import SHARES, FaultConfig
from systems.cell.pose_camera import CAMERAS, CameraConfig
from systems.controller_model import ControllerModelConfig
from systems.feedforward import FEEDFORWARDS, FeedforwardConfig
from systems.guard.guard import GuardConfig
from systems.link.abb.controller import EgmRunConfig
from systems.link.abb.motion import EgmMotionConfig
from systems.link.abb.signals import SignalCodec, SignalLayout
from systems.link.qualisys.receiver import MocapReceiverConfig
from systems.reference.paths import ReferenceConfig
from systems.servo import LAWS, LawConfig
from systems.servo.self_calibrating_config import SelfCalibratingConfig

__all__ = ["Scenario", "ScenarioError", "load_scenario", "scenario_text", "shipped_scenarios"]


@dataclass
class EgmConfig:
    """Externally Guided Motion on the controller."""

    motion: EgmMotionConfig = field(default_factory=EgmMotionConfig)
    run: EgmRunConfig = field(default_factory=EgmRunConfig)


@dataclass
class LinkConfig:
    """Where the controller and the camera of a real station are, and what to do when they fall silent."""

    address: str = "127.0.0.1"  # of this machine, to listen on for the controller
    port: int = 6510  # where the controller sends its messages
    controller: str = ""  # its address; empty to take whoever speaks first
    connect: float = 10.0  # s to wait for controller and camera
    break_after: float = 0.1  # s of silence after which the controller counts as gone
    on_break: str = "end"  # what a run does then, or when the controller stops: end, or resume
    resume_within: float = 10.0  # s in which it must be back
    signal_port: int = 0  # of this machine, where test signals arrive; 0 for none
    signals: SignalLayout = field(default_factory=SignalLayout)
    has_camera: bool = True
    camera: MocapReceiverConfig = field(default_factory=MocapReceiverConfig)
    camera_frame: Placement = field(default_factory=Placement)  # of the camera system in the world
    tool_frame: Placement = field(default_factory=Placement)  # of the tool in the body that the camera tracks


@dataclass
class Variation:
    """By how much springs and friction of the true robot are off its drawing: drawn within +- the shares."""

    stiffness: float = 0.0  # of each gear, bearing and beam
    friction: float = 0.0  # viscous and Coulomb, of each joint
    seed: int = 0


@dataclass
class StationConfig:
    """The robot cell: what the controller does not see, and what it is connected to."""

    kind: str = "simulated"  # or egm: a controller and a camera at the addresses of ``link``
    period: float = 4e-3  # s, between two commands and between two joint samples
    elasticity: str = "joints"  # of the true robot: rigid, joints or structure
    payload: float = 0.0  # kg at the flange
    payload_centre_mm: list[float] = field(default_factory=list)  # three; empty: as the robot's file has it
    variation: Variation = field(default_factory=Variation)
    link_growth_ppm_per_hour: float = 0.0  # of the warming links
    encoder: EncoderConfig = field(default_factory=EncoderConfig)
    errors: GeometricErrors = field(default_factory=GeometricErrors)
    drive: DriveConfig = field(default_factory=DriveConfig)
    camera: CameraConfig = field(default_factory=CameraConfig)
    markers: MarkerCameraConfig = field(default_factory=MarkerCameraConfig)  # of a camera that is not a pose
    interface: str = "direct"  # from command to drives: direct, or egm as a controller under EGM plans
    egm: EgmConfig = field(default_factory=EgmConfig)
    link: LinkConfig = field(default_factory=LinkConfig)
    faults: FaultConfig = field(default_factory=FaultConfig)
    events: list[StationEvent] = field(default_factory=list)  # of runs along a path


@dataclass
class ServoConfig:
    """The controller: what it believes, gains of each law, and the guard."""

    model: ControllerModelConfig = field(default_factory=ControllerModelConfig)
    laws: dict[str, LawConfig] = field(
        default_factory=lambda: {name: LawConfig() for name in LAWS if name != "self_calibrating"}
    )
    self_calibrating: SelfCalibratingConfig = field(default_factory=SelfCalibratingConfig)
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


STATIONS = ("simulated", "egm")

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
    "station.egm.motion.gain": (0.0, 20.0, "1/s"),
    "station.egm.motion.bandwidth": (0.0, 1000.0, "Hz"),
    "station.egm.motion.ramp_in": (0.0, 10.0, "s"),
    "station.egm.motion.largest_speed_deviation_deg_s": (0.0, 1000.0, "deg/s"),
    "station.egm.motion.stop_time": (0.0, 10.0, "s"),
    "station.egm.run.timeout": (0.01, 60.0, "s"),
    "station.egm.run.condition_deg": (1e-6, 360.0, "deg"),
    "station.egm.run.condition_time": (1e-3, 3600.0, "s"),
    "station.link.port": (0, 65535, ""),
    "station.link.signal_port": (0, 65535, ""),
    "station.link.camera.server.port": (0, 65535, ""),
    "station.link.connect": (0.1, 3600.0, "s"),
    "station.link.break_after": (0.01, 10.0, "s"),
    "station.link.resume_within": (0.1, 3600.0, "s"),
    **{f"station.faults.{name}": (0.0, 1.0, "") for name in SHARES},
    "station.faults.jitter": (0.0, 1.0, "s"),
    "station.faults.clock_drift_ppm": (-1e5, 1e5, "ppm"),
    "reference.acceleration": (1e-3, 100.0, "1/s^2"),
    "reference.settle": (0.0, 600.0, "s"),
    "reference.dwell": (0.0, 600.0, "s"),
    "reference.preview": (0.0, 1.0, "s"),
    "servo.model.mismatch.stiffness": (0.0, 0.9, ""),
    "servo.model.mismatch.payload": (0.0, 0.9, ""),
    "servo.model.mismatch.friction": (0.0, 0.9, ""),
    "servo.model.mismatch.seed": (0, 2**32 - 1, ""),
    "servo.feedforward.stiffness_error": (-0.9, 10.0, ""),
    "servo.feedforward.inertia_error": (-0.9, 10.0, ""),
    "servo.guard.hold_after": (1e-3, 10.0, "s"),
    "servo.guard.stop_after": (1e-3, 60.0, "s"),
    "servo.guard.stop_time": (1e-3, 10.0, "s"),
    "servo.guard.resume_time": (1e-3, 60.0, "s"),
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
    if scenario.station.drive.payload is not None:
        _in_range("station.drive.payload", scenario.station.drive.payload, _RANGES["station.payload"])
    _check_model(scenario.servo.model)
    LAWS.find(scenario.law)
    if scenario.servo.feedforward.kind != "none":
        FEEDFORWARDS.find(scenario.servo.feedforward.kind)
    _one_of("station.kind", scenario.station.kind, STATIONS)
    _one_of("station.camera.kind", scenario.station.camera.kind, CAMERAS)
    _one_of("station.interface", scenario.station.interface, ("direct", "egm"))
    _one_of("station.link.on_break", scenario.station.link.on_break, ("end", "resume"))
    SignalCodec(scenario.station.link.signals)
    _one_of("station.elasticity", scenario.station.elasticity, ELASTICITIES)
    integrator = scenario.integrator
    _one_of("integrator.scheme", integrator.scheme, ("auto", *GetIntegrationSchemes()))
    if integrator.accuracy is not None:
        _in_range("integrator.accuracy", integrator.accuracy, (1e-12, 1e-1, "relative"))
    if integrator.max_step is not None:
        _in_range("integrator.max_step", integrator.max_step, (1e-6, 0.1, "s"))


def _check_model(model: ControllerModelConfig) -> None:
    if model.payload is not None:
        _in_range("servo.model.payload", model.payload, _RANGES["station.payload"])
    for label in ("camera_delay", "command_delay"):
        if getattr(model, label) is not None:
            _in_range(f"servo.model.{label}", getattr(model, label), _RANGES["station.camera.delay"])
    for label in ("stiffness", "friction"):
        for factor in getattr(model, label):
            _in_range(f"servo.model.{label}", factor, (0.01, 100.0, ""))
    if model.structure is not None:
        _in_range("servo.model.structure", model.structure, (0.01, 100.0, ""))
    if model.elasticity:
        _one_of("servo.model.elasticity", model.elasticity, ELASTICITIES)


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
        plain = {entry.name: _plain(getattr(value, entry.name)) for entry in fields(value)}
        return {"_tag": f"!{type(value).__name__}", **plain} if isinstance(value, StationEvent) else plain
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(entry) for entry in value]
    return value.item() if isinstance(value, np.generic) else value

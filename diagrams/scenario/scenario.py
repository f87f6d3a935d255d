"""The one configuration of an experiment, read from YAML and checked before anything is built."""

from dataclasses import dataclass, field

import numpy as np
from pydrake.common.yaml import yaml_dump, yaml_dump_typed, yaml_load

from diagrams.integration import IntegratorConfig
from diagrams.scenario.own_laws import without_own_laws
from diagrams.scenario.scenario_file import ScenarioError, read_scenario_nodes, shipped_scenarios
from robots.configuration.nodes import ConfigurationError
from robots.configuration.quantity import choice, file_name, numbers, quantity
from robots.configuration.typed import typed
from robots.description.geometric_errors import GeometricErrors
from robots.description.model import NUM_JOINTS
from robots.dynamics.plant import ELASTICITIES
from systems.cell.cameras import CameraConfig
from systems.cell.drive import DriveConfig
from systems.cell.encoders import EncoderConfig
from systems.cell.events.station_events import StationEvent
from systems.cell.network_faults import FaultConfig
from systems.cell.overview.overview_camera import OverviewConfig
from systems.cell.pose_camera import PoseCameraConfig, no_window
from systems.controller_model import ControllerModelConfig
from systems.feedforward import FEEDFORWARDS, FeedforwardConfig
from systems.guard.guard import GuardConfig
from systems.guard.separation.protective_distance import SeparationConfig
from systems.link.makers import LINK_NAMES, RobotLinkConfig, default_link
from systems.named_classes import read_changed_files_again
from systems.reference.paths import ReferenceConfig
from systems.servo import LAWS
from systems.servo.gains import LawGains
from systems.vision.people.people_detector import DetectorConfig

__all__ = ["Scenario", "ScenarioError", "load_scenario", "scenario_text", "shipped_scenarios"]


@dataclass
class Variation:
    """By how much the true robot is off its file: springs and friction drawn within +- the shares."""

    stiffness: float = quantity(0.0, 0.0, 0.9)  # of each gear, bearing and beam
    friction: float = quantity(0.0, 0.0, 0.9)  # viscous and Coulomb, of each joint
    seed: int = quantity(0, 0, 2**32 - 1)  # of the random draw
    backlash: float = quantity(1.0, 0.0, 20.0)  # by what the gaps between teeth are multiplied


@dataclass
class StationConfig:
    """The robot cell: what the controller does not see, and what it is connected to."""

    # Or the name of a link: a controller and a camera at the addresses of ``link``
    kind: str = choice("simulated", ("simulated", *LINK_NAMES))
    period: float = quantity(4e-3, 5e-4, 0.1, "s")  # between two commands and between two joint samples
    elasticity: str = choice("joints", ELASTICITIES)  # of the true robot: rigid, joints or structure
    payload: float = quantity(0.0, 0.0, 1000.0, "kg")  # at the flange
    # Three, of the payload in the flange's frame; empty: as the robot's file has it
    payload_centre_mm: list[float] = numbers((), (0, 3), unit="mm")
    variation: Variation = field(default_factory=Variation)
    link_growth_ppm_per_hour: float = 0.0  # of the warming links
    encoder: EncoderConfig = field(default_factory=EncoderConfig)
    errors: GeometricErrors = field(default_factory=GeometricErrors)
    drive: DriveConfig = field(default_factory=DriveConfig)
    # What gives the poses of the tool: a whole camera system, or poses with noise
    camera: CameraConfig = field(default_factory=PoseCameraConfig)
    # From command to drives: direct, or as the controller of ``link`` plans
    interface: str = choice("direct", ("direct", *LINK_NAMES))
    # How a real or virtual controller is reached: ABB's EGM or KUKA's RSI
    link: RobotLinkConfig = field(default_factory=default_link)
    faults: FaultConfig = field(default_factory=FaultConfig)
    events: list[StationEvent] = field(default_factory=list)  # of runs along a path
    overview: OverviewConfig = field(default_factory=OverviewConfig)  # whole images, in which people are seen


@dataclass
class ServoConfig:
    """The controller: what it believes, gains of each law, and the guard."""

    model: ControllerModelConfig = field(default_factory=ControllerModelConfig)
    laws: LawGains = field(default_factory=LawGains)
    feedforward: FeedforwardConfig = field(default_factory=FeedforwardConfig)
    guard: GuardConfig = field(default_factory=GuardConfig)
    people: DetectorConfig = field(default_factory=DetectorConfig)
    separation: SeparationConfig = field(default_factory=SeparationConfig)


@dataclass
class Scenario:
    """Everything that an experiment needs to know."""

    description: str = ""  # one line, for lists and reports
    robot: str = file_name("irb1200")  # a shipped robot or the path of a robot file
    law: str = file_name("numerical_ik")  # the law that `truetip run` runs
    seed: int = quantity(0, 0, 2**32 - 1)  # of the camera's noise
    home_deg: np.ndarray = field(
        default_factory=lambda: np.zeros(NUM_JOINTS)
    )  # the branch nearest to it is used
    initial_error_mm: np.ndarray = field(default_factory=lambda: np.zeros(3))  # the tip starts so far off
    station: StationConfig = field(default_factory=StationConfig)
    reference: ReferenceConfig = field(default_factory=ReferenceConfig)
    servo: ServoConfig = field(default_factory=ServoConfig)
    integrator: IntegratorConfig = field(default_factory=IntegratorConfig)


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
    read_changed_files_again()
    try:
        node = read_scenario_nodes(name, settings or [], Scenario)
        shipped, own = without_own_laws(node)
        scenario = typed(shipped, Scenario)
        scenario.servo.laws.own = own
        found = _contradiction(scenario)
        if found:
            keys, reason = found
            raise node.at(keys).refuse(reason)
    except ScenarioError:
        raise
    except ConfigurationError as error:
        raise ScenarioError(str(error)) from error
    return scenario


def scenario_text(scenario: Scenario) -> str:
    """The whole scenario as YAML that `load_scenario` reads back."""
    text = str(yaml_dump_typed(scenario))
    events, own = scenario.station.events, scenario.servo.laws.own
    if not events and not own:
        return text
    tree = yaml_load(data=text)
    tree["servo"]["laws"] |= {law: said.plain for law, said in own.items()}
    # Drake leaves out the tag of the first kind; an event must always say what it is.
    for entry, event in zip(tree["station"]["events"], events, strict=True):
        entry["_tag"] = f"!{type(event).__name__}"
    return str(yaml_dump(tree))


def _contradiction(scenario: Scenario) -> tuple[list[str | int], str] | None:
    """What no single number shows: the place of values that cannot be true together, and why; or None."""
    guard = scenario.servo.guard
    if not guard.hold_after < guard.stop_after:
        return ["servo", "guard", "hold_after"], (
            f"servo.guard.hold_after={guard.hold_after:g} s must be below servo.guard.stop_after="
            f"{guard.stop_after:g} s"
        )
    for number, window in enumerate(getattr(scenario.station.camera, "dropouts", ())):
        if no_window(window):
            return ["station", "camera", "dropouts", number], f"station.camera.dropouts: {no_window(window)}"
    try:
        LAWS.find(scenario.law)
    except ValueError as error:
        return ["law"], str(error)
    kind = scenario.servo.feedforward.kind
    try:
        if kind != "none":
            FEEDFORWARDS.find(kind)
    except ValueError as error:
        return ["servo", "feedforward", "kind"], str(error)
    link = scenario.station.link.kind
    for name, value in (("kind", scenario.station.kind), ("interface", scenario.station.interface)):
        if value in LINK_NAMES and value != link:
            return ["station", name], f"station.{name}={value} contradicts station.link, which is {link}"
    overview = scenario.station.overview
    if overview.enabled and scenario.station.kind != "simulated" and not overview.source:
        return ["station", "overview"], (
            f"station.overview.enabled with station.kind={scenario.station.kind} needs station.overview."
            "source, the address of the videos of the cameras (rtsp://host/{camera}), or nobody would be "
            "seen; drawn is for a virtual cell"
        )
    try:
        scenario.station.link.check()
    except ValueError as error:
        return ["station", "link"], f"station.link: {error}"
    return None

"""Prepares a run from command-line options; wrong input is refused before anything runs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console

from diagrams.runs.simulation import Experiment, nominal_robot
from diagrams.scenario.carried import HOME, PATH, carried_over, with_robot
from diagrams.scenario.kept import kept_text
from diagrams.scenario.scenario import Scenario, ScenarioError, load_scenario
from diagrams.scenario.scenario_file import OptionSetting, read_scenario_nodes, stated_keys
from experiments.cli.console import print_note
from robots.description.calibration import is_same_robot
from robots.description.model import RobotFileError, RobotModel, load_robot
from robots.description.placement import long_tool_note
from robots.description.source_notes import assumed_note, foreign_sources_note
from robots.dynamics.compliant_kinematics import controller_kinematics
from robots.kinematics.error_kinematics import ErrorKinematics
from systems.cell.events.station_events import check_events
from systems.named_classes import place_in_own_file
from systems.reference.paths import make_path
from systems.reference.shapes import Planned

QUICK_SPEEDUP = 4.0  # of the acceleration along the path
QUICK_SETTLE = 2.0  # s
_PREPARING = "Preparing the laws (the first time they are compiled, for up to a minute)"


@dataclass(frozen=True)
class Prepared:
    """A scenario with its robot, ready to run."""

    title: str  # the scenario's name and how this one differs from it
    scenario: Scenario
    robot: RobotModel  # as the controller knows it
    carried: str = ""  # what of the scenario was made to fit this robot, and what the controller knows of it
    calibrated: str = ""  # the file of the robot that the controller knows, where that is a calibrated one

    @property
    def nominal_robot(self) -> RobotModel:
        """The robot from which the true one differs by the station's errors."""
        return nominal_robot(self.scenario, self.robot)

    @property
    def true_robot(self) -> RobotModel:
        """The robot with the geometry that the simulated one truly has; the nominal one on a real station."""
        errors, nominal = self.scenario.station.errors, self.nominal_robot
        return ErrorKinematics(nominal).robot_with_errors(errors.vector(nominal))

    @property
    def note(self) -> str:
        """What a person should know before it runs, in a line; empty if there is nothing."""
        model, true = self.scenario.servo.feedforward.kind, self.scenario.station.elasticity
        stiffer = ""
        if model == "elastic_structure" and true != "structure":
            stiffer = (
                "the feedforward compensates an elastic structure that the robot does not have with "
                f"station.elasticity={true}"
            )
        return "; ".join(filter(None, (stiffer, self.carried, _file_note(self.robot))))

    @property
    def kept(self) -> str:
        """The whole scenario as YAML, to run it again: `kept_text`."""
        return kept_text(self.scenario, self.calibrated)

    @property
    def text(self) -> str:
        """The same under its title."""
        return f"# {self.title}\n{self.kept}"


def noted_robot(console: Console, name: str) -> RobotModel:
    """A robot by its name or file; says so if the sources in the file are those of another robot.

    Raises:
        ValueError: if there is no such robot, or its file cannot be read.
    """
    robot = load_robot(name)
    print_note(console, _file_note(robot))
    return robot


def _file_note(robot: RobotModel) -> str:
    """What in the file of a robot may be wrong, in a line; empty if nothing."""
    return "; ".join(
        filter(None, (foreign_sources_note(robot), long_tool_note(robot.tool), assumed_note(robot)))
    )


def with_assumed(result: dict[str, Any], robot: RobotModel) -> dict[str, Any]:
    """The numbers of a command with what is ``assumed`` of its robot, where that is all of its springs."""
    note = assumed_note(robot)
    return result | ({"assumed": note} if note else {})


def prepare(
    name: str,
    settings: Sequence[str] = (),
    robot: str | None = None,
    is_quick: bool = False,
    needs_path: bool = True,
) -> Prepared:
    """Reads a scenario and its robot.

    Args:
        name: a shipped scenario or the path of a scenario file.
        settings: changes such as ``"station.payload=0"``.
        robot: a shipped robot or the path of a robot file; None for the scenario's. A calibrated robot serves
            the controller alone.
        is_quick: whether to make it `quick`.
        needs_path: whether the path of the scenario is carried over to a robot for which it was not written.

    Raises:
        ValueError: if something is missing, unknown, out of range or not readable.
    """
    scenario = load_scenario(name, list(settings))
    differences = list(settings)
    calibrated = _calibrated_belief(scenario) if robot is None else ""
    if robot is not None:
        model = load_robot(robot)
        if model.calibration.of:  # it is what the controller knows, whatever the scenario says
            calibrated = robot
        else:
            scenario = with_robot(scenario, robot)
        differences.append(f"robot={robot}")
    else:
        model = load_robot(calibrated) if calibrated else _robot_of(name, settings, scenario)
    if calibrated:
        belief = replace(scenario.servo.model, robot="")
        scenario = replace(scenario, servo=replace(scenario.servo, model=belief))
    scenario, carried = _fitted(name, settings, scenario, robot, needs_path)
    if robot is not None and scenario.servo.model.robot:
        known = f"the controller knows {load_robot(scenario.servo.model.robot).name}"
        carried = "; ".join(filter(None, (carried, known)))
    if needs_path and isinstance(scenario.reference.path, Planned):
        scenario.reference.path.motion(controller_kinematics(model, scenario.station.payload).forward)
    if is_quick:
        scenario, note = quick(scenario, settings)
        differences.append(f"quick: {note}")
    if needs_path and scenario.station.kind == "simulated" and scenario.station.events:
        _require_possible_events(name, settings, scenario)
    title = Path(name).stem + (f" ({'; '.join(differences)})" if differences else "")
    return Prepared(title, scenario, model, carried, calibrated)


def _calibrated_belief(scenario: Scenario) -> str:
    """The file of the calibrated robot in `servo.model.robot`; empty where that is none of the station's."""
    name = scenario.servo.model.robot
    of = load_robot(name).calibration.of if name else ""
    return name if of and is_same_robot(of, scenario.robot) else ""


def _robot_of(name: str, settings: Sequence[str], scenario: Scenario) -> RobotModel:
    """The robot of a scenario. Raises RobotFileError, with the place that names it."""
    try:
        return load_robot(scenario.robot)
    except RobotFileError as error:
        node = read_scenario_nodes(name, list(settings), Scenario)
        if "robot" not in node.value:
            raise
        raise RobotFileError(f"{node.at(['robot']).place}: robot: {error}") from error


def _require_possible_events(name: str, settings: Sequence[str], scenario: Scenario) -> None:
    """Raises ScenarioError if an event is not within the run, with the place of the events."""
    station, end = scenario.station, make_path(scenario.reference).duration
    try:
        check_events(station.events, end, station.drive.dead_time)
    except ValueError as error:
        node = read_scenario_nodes(name, list(settings), Scenario)
        raise ScenarioError(f"{node.at(['station', 'events']).place}: {error}") from error


def _fitted(
    name: str, settings: Sequence[str], scenario: Scenario, robot: str | None, needs_path: bool
) -> tuple[Scenario, str]:
    """The scenario `carried_over` from the robot for which its path was written, and what has changed.

    A path that the scenario says itself belongs to its robot; else it is the default one and its robot's.
    A robot among the settings is as one beside them: the scenario was not written for it.
    """
    others = [setting for setting in settings if setting.partition("=")[0].strip() != "robot"]
    if robot is None and len(others) < len(settings):
        robot = str(scenario.robot)
    by_scenario = stated_keys(read_scenario_nodes(name, others, Scenario))
    named = str(load_scenario(name, others).robot)
    own = PATH in by_scenario
    before = named if own else Scenario().robot
    if scenario.robot == before:
        return scenario, ""
    stated = {setting.partition("=")[0].strip() for setting in settings}
    if robot is None or robot == named:
        stated |= by_scenario
    if not needs_path:
        stated |= {PATH, HOME}
    return carried_over(scenario, load_robot(before), load_robot(scenario.robot), stated)


def simulated_only(prepared: Prepared, command: str, instead: str) -> None:
    """Refuses a scenario of a real station for a command that would only simulate one.

    Raises:
        ValueError: that names the kind of the station and what to do instead.
    """
    kind = prepared.scenario.station.kind
    if kind != "simulated":
        raise ValueError(
            f"{command} does not drive a real station, got station.kind={kind}: {instead}, or set "
            "station.kind=simulated"
        )


def quick(scenario: Scenario, settings: Sequence[str] = ()) -> tuple[Scenario, str]:
    """A scenario that takes a few seconds in one cycle, and in words what makes it quick.

    The path is run with four times the acceleration after settling for at most 2 s; what ``settings``
    (``"reference.settle=3"``) name explicitly stays as it is.
    """
    named = {setting.partition("=")[0].strip() for setting in settings}
    reference, notes = scenario.reference, ["one cycle"]
    if "reference.acceleration" not in named:
        reference = replace(reference, acceleration=min(100.0, QUICK_SPEEDUP * reference.acceleration))
        notes.append(f"acceleration {reference.acceleration:g} 1/s^2")
    if "reference.settle" not in named and reference.settle > QUICK_SETTLE:
        reference = replace(reference, settle=QUICK_SETTLE)
        notes.append(f"settling {reference.settle:g} s")
    return replace(scenario, reference=reference), ", ".join(notes)


def check(prepared: Prepared, laws: Sequence[str]) -> None:
    """Builds the diagram of every law once, so that what cannot run is refused before anything does.

    What laws work out in every tick is compiled then, if it has not been, and not in every process anew.

    Raises:
        ValueError: if the path is out of reach or a part refuses its configuration.
    """
    with Console(stderr=True).status(_PREPARING):
        for law in laws:
            try:
                Experiment(prepared.scenario, law, prepared.robot)
            except RuntimeError as error:  # what Drake does not like, such as an unknown integration scheme
                if place_in_own_file(error) is not None:
                    raise
                raise ScenarioError(f"scenario {prepared.title}: {' '.join(str(error).split())}") from error


def option_settings(
    settings: list[str] | None,
    law: str | None,
    feedforward: str | None,
    camera: str | None = None,
    laps: int | None = None,
) -> list[str]:
    """The changes of a scenario that options of their own make, behind those of --set.

    Raises:
        ValueError: if a class is missing behind its file.
    """
    for option, named in (("--law", law), ("--feedforward", feedforward)):
        if named and named.rstrip().endswith(":"):
            raise ValueError(f"{option} {named}: the name of the class is missing, as in mine.py:MyClass")
    own = (
        OptionSetting(key, value, option)
        for key, value, option in (
            ("law", law, "--law"),
            ("servo.feedforward.kind", feedforward, "--feedforward"),
            ("station.camera.kind", camera, "--camera"),
            ("reference.laps", laps, "--laps"),
        )
        if value is not None
    )
    return [*(settings or []), *own]

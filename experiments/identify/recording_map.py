"""What a recording of motions is, and the map that says what the columns of its table are."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from experiments.identify.recording_grid import UNEVEN, EvenGrid, even_grid
from robots.configuration.nodes import Node
from robots.configuration.quantity import choice, numbers, positive, quantity
from robots.description.model import NUM_JOINTS
from robots.identification.motion import KINDS, SensorPlace
from robots.identification.recording import RecordedCase, RecordingError
from robots.pose import rotation_from_zyx, zyx_from_rotation

_LEAST = 50  # samples of a case
_SLOWEST = 0.5  # s, between samples: beyond it a time is in ms
_FARTHEST = 10.0  # m, of a sensor from the frame of its body: beyond it a place is in mm
_COMMANDS = ("position", "speed", "torque")


@dataclass
class RecordedSensor:
    """A sensor and its three columns."""

    name: str = ""
    kind: str = choice("gyro", KINDS)
    body: str = ""
    position: list[float] = numbers((0.0, 0.0, 0.0), (3,), -_FARTHEST, _FARTHEST, unit="m")
    zyx_deg: list[float] = numbers((0.0, 0.0, 0.0), (3,), unit="deg")
    bandwidth: float = positive(200.0, "Hz")
    noise_sigma: float = positive(2e-3)  # rad/s or m/s^2
    columns: list[str] = field(default_factory=list)
    factor: float = 1.0  # from the unit of the columns to rad/s or m/s^2


@dataclass
class RecordingMap:
    """What the columns of a recording are."""

    payload: float | None = quantity(None, 0.0, unit="kg")  # at the flange; None for the largest
    payloads: dict[str, float] = field(
        default_factory=dict
    )  # kg, of motions with another one, by their names
    case: str = "case"  # column with the name of the motion; empty where there is only one
    time: str = "time"  # column, s by the robot's clock
    stamp: str = ""  # column, s by the clock of the sensors; empty for that of the robot
    angle_factor: float = 1.0  # from the unit of positions and speeds to rad and rad/s
    position: list[str] = field(default_factory=list)  # six columns, motors on the side of the links
    speed: list[str] = field(default_factory=list)  # six columns; empty: differentiated
    torque: list[str] = field(default_factory=list)  # six columns, N m on the side of the links; may be empty
    # What the drives were told last: 18 columns, six positions, six speeds, six torques (N m); may be empty
    command: list[str] = field(default_factory=list)
    command_period: float = positive(4e-3, "s")  # from one command to the next; the first row has a new one
    sensors: list[RecordedSensor] = field(default_factory=list)


@dataclass(frozen=True)
class Recording:
    """Motions with the sensors that watched them."""

    payload: float | None  # kg
    cases: list[RecordedCase]
    sensors: list[SensorPlace]
    command_period: float = 4e-3  # s


def map_of(recording: Recording, has_torque: bool, has_command: bool) -> RecordingMap:
    """The map of a table of a recording, with names for all columns."""
    joints = range(1, NUM_JOINTS + 1)
    return RecordingMap(
        recording.payload,
        {case.name: case.payload for case in recording.cases if case.payload is not None},
        stamp="stamp",
        position=[f"position_{i}" for i in joints],
        speed=[f"speed_{i}" for i in joints],
        torque=[f"torque_{i}" for i in joints] if has_torque else [],
        command=[f"command_{kind}_{i}" for kind in _COMMANDS for i in joints] if has_command else [],
        command_period=recording.command_period,
        sensors=[
            RecordedSensor(
                place.name,
                place.kind,
                place.body,
                place.position.tolist(),
                np.rad2deg(zyx_from_rotation(place.rotation)).tolist(),
                place.bandwidth,
                place.sigma,
                [f"{place.name}_{axis}" for axis in "xyz"],
            )
            for place in recording.sensors
        ],
    )


def places(plan: RecordingMap) -> list[SensorPlace]:
    """The sensors of a map."""
    return [
        SensorPlace(
            sensor.name,
            sensor.kind,
            sensor.body,
            np.array(sensor.position, dtype=float),
            rotation_from_zyx(np.deg2rad(sensor.zyx_deg)),
            sensor.bandwidth,
            sensor.noise_sigma,
        )
        for sensor in plan.sensors
    ]


def check_map(plan: RecordingMap, node: Node, needs_sensors: bool) -> None:
    """Refuses a map that lacks columns, names one twice, or makes nothing of them.

    Raises:
        ConfigurationError: that names the place.
    """
    if plan.angle_factor == 0.0:
        raise node.at(["angle_factor"]).refuse("angle_factor must not be 0")
    for name, wanted in (
        ("position", (NUM_JOINTS,)),
        ("speed", (0, NUM_JOINTS)),
        ("torque", (0, NUM_JOINTS)),
        ("command", (0, len(_COMMANDS) * NUM_JOINTS)),
    ):
        columns = getattr(plan, name)
        if len(columns) not in wanted:
            raise node.at([name]).refuse(f"{name} must be {wanted[-1]} columns, got {len(columns)}")
    for name, payload in plan.payloads.items():
        if not payload >= 0.0:
            raise node.at(["payloads", name]).refuse(
                f"payloads.{name} must not be negative, got {payload:g} kg"
            )
    if not plan.sensors and needs_sensors:
        raise node.refuse("sensors: needs one or more, each with name, kind, body and three columns")
    taken = [(name, node.at([name])) for name in ("position", "speed", "torque", "command")]
    groups = [(getattr(plan, name), name, place) for name, place in taken]
    for i, sensor in enumerate(plan.sensors):
        place = node.at(["sensors", i])
        if len(sensor.columns) != 3:
            raise place.refuse(f"sensor '{sensor.name}': columns must be 3, got {len(sensor.columns)}")
        if sensor.factor == 0.0:
            raise place.refuse(f"sensor '{sensor.name}': factor must not be 0")
        if sensor.name in [each.name for each in plan.sensors[:i]]:
            raise place.refuse(f"sensor '{sensor.name}': two have this name")
        groups.append((sensor.columns, f"sensor '{sensor.name}'", place))
    known: dict[str, str] = {}
    for columns, what, place in groups:
        for column in columns:
            if column in known:
                raise place.refuse(f"{what}: column '{column}' is that of {known[column]} already")
            known[column] = what


def check_payloads(path: Path, plan: RecordingMap, cases: list[RecordedCase]) -> None:
    """Refuses payloads of motions that are not there. Raises RecordingError."""
    names = [case.name for case in cases]
    unknown = [name for name in plan.payloads if name not in names]
    if unknown:
        raise RecordingError(f"{path}: payloads: no case '{unknown[0]}', there are {', '.join(names)}")


def check_times(where: Callable[[int], str], time: np.ndarray, stamps: np.ndarray) -> EvenGrid:
    """The grid of a motion; refuses one that is too short, goes back in time or was sampled unevenly.

    Args:
        where: the place of a row of the motion, for messages.
        time: by the clock of the robot in s.
        stamps: by the clock of the sensors in s.

    Raises:
        RecordingError: that names the place.
    """
    if len(time) < _LEAST:
        raise RecordingError(f"{where(0)}: a case needs {_LEAST} rows or more, got {len(time)}")
    for name, values in (("time", time), ("stamp", stamps)):
        steps = np.diff(values)
        if not steps.min() > 0.0:
            raise RecordingError(f"{where(int(np.argmin(steps)) + 1)}: the {name} does not go on")
    steps = np.diff(time)
    period = float(np.median(steps))
    if period > _SLOWEST:
        raise RecordingError(
            f"{where(1)}: samples of the robot are {period:g} s apart; the time must be in s"
        )
    return even_grid(where, time)


def check_periods(path: Path, cases: list[RecordedCase]) -> None:
    """Refuses motions that were sampled at different rates. Raises RecordingError."""
    periods = [case.period for case in cases]
    if max(periods) > (1.0 + UNEVEN) * min(periods):
        raise RecordingError(
            f"{path}: all cases must have one period, got {min(periods):g} to {max(periods):g} s"
        )

"""A scenario carried over to a robot for which it was not written.

Path, load and home position of a scenario fit one robot. Another one gets the same path at its own size:
turned and moved so that the middle of the path, with the tool's orientation there, is a place where this
robot moves freely, smaller where it would not reach all of it, and slower where its joints are slow. Its load
is the same share of what it may carry, and its motors are controlled as quickly. What is said explicitly, as
by ``--set``, stays.
"""

import math
from collections.abc import Collection, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import Any

import numpy as np

from diagrams.scenario.scenario import Scenario, ScenarioError
from robots.description.model import RobotModel, base_robot
from robots.kinematics.forward import Kinematics
from robots.kinematics.numeric_inverse import NumericInverse
from robots.kinematics.workspace import arm_length, dexterity, front, working_positions
from robots.measurement_design.constraints import AdmissibleConfigurations
from robots.pose import rotation_from_zyx, zyx_from_rotation
from systems.cell.events.station_events import PayloadChange
from systems.estimation.drives.drive_gains import straight_inertia
from systems.reference.paths import ReferenceConfig, make_path
from systems.reference.shapes import Circle, Planned, Points, Rectangle, Shape, Waypoint
from systems.servo.self_calibrating.config import SelfCalibratingConfig

# What is carried over
PATH, SPEED, HOME, PAYLOAD = "reference.path", "reference.acceleration", "home_deg", "station.payload"
GAINS = tuple(f"station.drive.{name}" for name in ("position", "velocity", "motor_factors"))
_LEARNING = "self_calibrating"  # the law that believes something of the drives
_SAME = 0.05  # m, and of direction cosines: robots that are one machine with errors differ by less
_PLACES = (12, 96)  # for its middle, the best first; the others where none of the first will do
# Sizes of the path, over what the lengths of the arms say: rather slower than very small
_SIZES = (1.0, 0.8, 0.6, 0.45, 0.3), (0.2, 0.12)
_SLOWEST = 0.03  # times its acceleration, for slow joints
_SAMPLES = 120  # of a path, at which it is tried
_JUMP = 0.6  # rad between two of them: another branch
_MARGIN = np.deg2rad(3.0)  # from the limits of the joints
_SPEED = 0.4  # share of the largest joint speeds: a quick comparison is twice as fast
_DEXTERITY = 0.25  # on the path, over that of the best position
# Of the length of the arm, by which poses may be moved away where it is stretched most: robots differ from
# their drawings by centimetres at the tool
_REACH, _STEPS, _WEAKEST = 0.05, 5, 8
_ARM = 0.25  # m, by which a turn counts as a way


def is_alike(robot: RobotModel, other: RobotModel) -> bool:
    """Whether two robots are one machine, or one with errors: the tools are at nearly the same places."""
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (8, 6))
    return bool(np.abs(Kinematics(robot).forward(q) - Kinematics(other).forward(q)).max() < _SAME)


def with_robot(scenario: Scenario, name: str) -> Scenario:
    """The scenario with another robot in the station, shipped or a file; the controller knows that one.

    Where the controller of the scenario believes in the robot that the true one is written on top of, as a
    drawing that knows of no play and no hysteresis, that is so with the other one, too.
    """
    model = scenario.servo.model
    believes_in_drawing = bool(model.robot) and model.robot == base_robot(str(scenario.robot))
    belief = (base_robot(name) if believes_in_drawing else None) or ""
    return replace(scenario, robot=name, servo=replace(scenario.servo, model=replace(model, robot=belief)))


def carried_over(
    scenario: Scenario, before: RobotModel, robot: RobotModel, stated: Collection[str] = ()
) -> tuple[Scenario, str]:
    """The scenario for another robot.

    Args:
        scenario: as it was written.
        before: the robot for which it was written.
        robot: the one that is to run it.
        stated: which of `PATH`, `HOME`, `PAYLOAD`, `GAINS`, or fields of them, are said for this very robot.

    Returns:
        The scenario, and what has changed in words; the same scenario and nothing if the robots are alike.

    Raises:
        ScenarioError: if no place for the path is found.
    """
    if is_alike(before, robot):
        return scenario, ""
    notes = []
    if not _is_stated(PAYLOAD, stated):
        scenario = _with_load(scenario, before, robot)
        notes.append(f"payload {scenario.station.payload:g} kg")
    if not any(_is_stated(key, stated) for key in GAINS):
        scenario = _with_gains(scenario, before, robot)
        factors = scenario.station.drive.motor_factors
        notes.append(f"gains of its motors {min(factors):g} to {max(factors):g} times as large")
    if not _is_stated(PATH, stated):
        placed = _place(scenario, before, robot, not _is_stated(SPEED, stated))
        usual = scenario.reference.acceleration
        reference = replace(scenario.reference, path=placed.path, acceleration=placed.acceleration)
        scenario = replace(scenario, reference=reference)
        if not _is_stated(HOME, stated):
            scenario = replace(scenario, home_deg=np.round(np.rad2deg(placed.start), 3))
        notes.append(f"path {placed.scale:.2g} times as large, at {_metres(placed.middle)} m")
        if placed.acceleration < usual:
            notes.append(f"its acceleration {placed.acceleration:.2g} 1/s^2, as its joints are slow")
    return scenario, f"carried over from {before.name} to {robot.name}: {', '.join(notes)}" if notes else ""


def _is_stated(key: str, stated: Collection[str]) -> bool:
    return any(each == key or each.startswith(f"{key}.") for each in stated)


def _metres(p: np.ndarray) -> str:
    return ", ".join(f"{value:.2f}" for value in p)


def _with_load(scenario: Scenario, before: RobotModel, robot: RobotModel) -> Scenario:
    """The same share of the largest payload, as far from where the robot's file has its centre.

    Also in what the controllers believe and in what happens.
    """
    largest = before.payload.largest_mass
    share = robot.payload.largest_mass / largest if largest > 0.0 else 0.0
    further = 1e3 * (robot.payload.center_of_mass - before.payload.center_of_mass)
    station, model = scenario.station, scenario.servo.model

    def carried(mass: float | None) -> float | None:
        return None if mass is None else round(share * mass, 4)

    def beside(centre_mm: list[float]) -> list[float]:
        return np.round(further + centre_mm, 3).tolist() if centre_mm else []

    events = [
        replace(event, payload=carried(event.payload), centre_mm=beside(event.centre_mm))
        if isinstance(event, PayloadChange)
        else event
        for event in station.events
    ]
    station = replace(
        station,
        payload=carried(station.payload),
        payload_centre_mm=beside(station.payload_centre_mm),
        drive=replace(station.drive, payload=carried(station.drive.payload)),
        events=events,
    )
    model = replace(model, payload=carried(model.payload), payload_centre_mm=beside(model.payload_centre_mm))
    return replace(scenario, station=station, servo=replace(scenario.servo, model=model))


def _with_gains(scenario: Scenario, before: RobotModel, robot: RobotModel) -> Scenario:
    """With as quick motors, though they turn more or less; also in what the controller believes.

    The gains of drives without a cascade are torques of a motor. Left as they are, the speed loops of an
    IRB 1200 are a hundred times as slow on a KR 210, and its weight moves it a hundred times as far.
    """
    now, then = (
        straight_inertia(each, each.payload.largest_mass) / np.abs(each.gear_ratio)
        for each in (robot, before)
    )
    station, laws = scenario.station, copy(scenario.servo.laws)  # as it is, with laws of one's own
    factors = [float(f"{each:.3g}") for each in now / then * station.drive.motor_factors]
    own = laws[_LEARNING]
    assert isinstance(own, SelfCalibratingConfig)
    setattr(laws, _LEARNING, replace(own, drives=replace(own.drives, motor_factors=factors)))
    station = replace(station, drive=replace(station.drive, motor_factors=factors))
    return replace(scenario, station=station, servo=replace(scenario.servo, laws=laws))


@dataclass(frozen=True)
class _Placed:
    """A path where a robot can follow it."""

    path: Shape
    start: np.ndarray  # rad, shape (6,)
    middle: np.ndarray  # m, shape (3,)
    scale: float
    acceleration: float  # 1/s^2, see `ReferenceConfig`


class _Motion:
    """Turns, moves and scales a path; the tool at its middle gets a new orientation."""

    def __init__(self, frames: Sequence[np.ndarray], middles: Sequence[np.ndarray], scale: float) -> None:
        """From the old to the new: ``frames`` at the fronts (3, 3), ``middles`` of the path (4, 4)."""
        self.turn = frames[1] @ frames[0].T
        self._old, self._new, self.scale = middles[0], middles[1], scale

    def point_mm(self, p: np.ndarray) -> np.ndarray:
        """Where a point goes, (3,) in mm both."""
        moved = self._new[:3, 3] + self.scale * self.turn @ (1e-3 * np.asarray(p) - self._old[:3, 3])
        return np.round(1e3 * moved, 4)

    def tool(self, zyx_deg: np.ndarray) -> np.ndarray:
        """The new orientation of the tool, ZYX angles in degrees, (3,) both."""
        relative = rotation_from_zyx(np.deg2rad(zyx_deg)) @ self._old[:3, :3].T
        return _degrees(self.turn @ relative @ self.turn.T @ self._new[:3, :3])

    def plane(self, zyx_deg: np.ndarray) -> np.ndarray:
        """The new orientation of a plane of the path, ZYX angles in degrees, (3,) both."""
        return _degrees(self.turn @ rotation_from_zyx(np.deg2rad(zyx_deg)))

    def of(self, path: Shape) -> Shape:
        """The path where it now is."""
        if isinstance(path, Planned):
            raise ScenarioError("a planned path belongs to the robot for which it was planned: plan it again")
        if isinstance(path, (Rectangle, Points)):
            points = [Waypoint(self.point_mm(w.translation_mm), self.tool(w.zyx_deg)) for w in path.waypoints]
            return replace(path, waypoints=points)
        moved: dict[str, Any] = {
            "center_mm": self.point_mm(path.center_mm),
            "plane_zyx_deg": self.plane(path.plane_zyx_deg),
            "zyx_deg": self.tool(path.zyx_deg),
        }
        if isinstance(path, Circle):
            return replace(path, radius_mm=self.scale * path.radius_mm, **moved)
        lengths = {"length_mm": self.scale * path.length_mm, "width_mm": self.scale * path.width_mm}
        return replace(path, **lengths, **moved)


def _degrees(rotation: np.ndarray) -> np.ndarray:
    return np.round(np.rad2deg(zyx_from_rotation(rotation)), 6)


def _place(scenario: Scenario, before: RobotModel, robot: RobotModel, may_slow: bool) -> _Placed:
    """Where the robot is quick enough for the path; else where the path is slowed least, for its size."""
    reference = scenario.reference
    is_slow, slowed = False, None
    for sizes in _SIZES:
        least = np.inf
        for place, speed in _places(reference, before, robot, sizes):
            if speed < 1.0:
                return place
            is_slow = True
            # Speeds go with the root of the acceleration.
            acceleration = 0.9 * reference.acceleration / speed**2
            if speed / place.scale < least and acceleration > _SLOWEST * reference.acceleration:
                least = speed / place.scale
                slowed = replace(place, acceleration=_shortened(acceleration))
        if slowed and may_slow:
            return slowed
    reason = (
        "its joints are too slow: --set reference.acceleration=..."
        if is_slow
        else "say where it is: --set reference.path=... and home_deg"
    )
    raise ScenarioError(
        f"no place was found where {robot.name} can follow the path '{reference.path.kind}' of "
        f"{before.name}; {reason}"
    )


def _places(
    reference: ReferenceConfig, before: RobotModel, robot: RobotModel, sizes: Sequence[float]
) -> Iterator[tuple[_Placed, float]]:
    """Where the robot can follow the path, the best first, and the share of the speeds that it may have."""
    old = _middle(reference)
    _, old_front = front(before, old[:3, 3])
    candidates = np.deg2rad([robot.home_deg]) if robot.home_deg else working_positions(robot, _PLACES[-1])
    admissible = AdmissibleConfigurations(robot)
    larger, best = arm_length(robot) / arm_length(before), 0.0
    for first, last in pairwise((0, *_PLACES)):
        positions = candidates[first:last]
        if not len(positions):
            break
        positions = positions[admissible(positions)] if admissible(positions).any() else positions
        best = max(best, float(dexterity(robot, positions).max()))
        trial = _Trial(reference, robot, admissible, _DEXTERITY * best)
        for size, q in product(sizes, positions):
            X = Kinematics(robot).forward(q)
            motion = _Motion([old_front, front(robot, X[:3, 3])[1]], [old, X], size * larger)
            path = motion.of(reference.path)
            followed = trial.follow(path, q)
            if followed:
                yield _Placed(path, followed[0], X[:3, 3], size * larger, reference.acceleration), followed[1]


def _shortened(value: float) -> float:
    """The next lower number of two digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return round(math.floor(value / unit) * unit, 12)


def _middle(reference: ReferenceConfig) -> np.ndarray:
    """The middle of a path: its mean position, and the mean of its orientations; (4, 4)."""
    path = make_path(reference)
    X = path.sample(np.linspace(path.path_start, path.dwell_start, _SAMPLES))[0]
    middle = X.mean(axis=0)
    U, _, Vt = np.linalg.svd(middle[:3, :3])
    middle[:3, :3] = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    return middle


def _waypoint(X: np.ndarray) -> Waypoint:
    return Waypoint(1e3 * X[:3, 3], np.rad2deg(zyx_from_rotation(X[:3, :3])))


class _Trial:
    """Whether a robot can follow a path freely, and how fast its joints are on it."""

    def __init__(
        self,
        reference: ReferenceConfig,
        robot: RobotModel,
        admissible: AdmissibleConfigurations,
        dexterity: float,
    ) -> None:
        self._reference, self._robot, self._admissible = reference, robot, admissible
        self._inverse, self._dexterity = NumericInverse(robot), dexterity
        self._kinematics = Kinematics(robot)

    def follow(self, path: Shape, q_middle: np.ndarray) -> tuple[np.ndarray, float] | None:
        """Where the path begins in rad, (6,), and the largest share of the speed that joints may have.

        None if it is not followed from its middle to both ends.
        """
        robot, timed = self._robot, make_path(replace(self._reference, path=path, laps=1))
        times = np.linspace(timed.path_start, timed.dwell_start, _SAMPLES)
        X = timed.sample(times)[0]
        # A straight way from the middle to the first pose, so that the branch is that of the middle.
        middle = _waypoint(self._kinematics.forward(q_middle))
        approach = make_path(ReferenceConfig(Rectangle([middle, _waypoint(X[0])]), dwell=0.0))
        way = approach.sample(np.linspace(0.0, approach.duration, _SAMPLES // 4))[0]
        q = self._followed(np.concatenate([way, X]), q_middle)
        if q is None:
            return None
        q = q[len(way) :]
        step = np.abs(np.diff(q, axis=0))
        is_free = (
            step.max() < _JUMP
            and np.all((q > robot.lower + _MARGIN) & (q < robot.upper - _MARGIN))
            and dexterity(robot, q).min() > self._dexterity
            and self._admissible(q[::8]).all()
        )
        speed = step / np.diff(times)[:, None] / (_SPEED * robot.speed)
        return (q[0], float(speed.max())) if is_free and self._has_reach_left(X, q) else None

    def _has_reach_left(self, X_WE: np.ndarray, q: np.ndarray) -> bool:
        """Whether a robot that differs from this one gets to poses (n, 4, 4), too, where this one is at q."""
        J = self._kinematics.jacobian(q)
        J[:, :3] *= _ARM
        U, weakness, _ = np.linalg.svd(J)
        ways = U[:, 3:, -1] / np.maximum(np.linalg.norm(U[:, 3:, -1], axis=1), 1e-9)[:, None]
        for k, side in product(np.argsort(weakness[:, -1], kind="stable")[:_WEAKEST], (1.0, -1.0)):
            away = np.repeat(X_WE[k : k + 1], _STEPS, axis=0)
            steps = side * _REACH * arm_length(self._robot) / _STEPS * np.arange(1, _STEPS + 1)
            away[:, :3, 3] += steps[:, None] * ways[k]
            if self._followed(away, q[k]) is None:
                return False
        return True

    def _followed(self, X_WE: np.ndarray, q: np.ndarray) -> np.ndarray | None:
        """Joint positions along poses (n, 4, 4) from a configuration on, (n, 6); None if it ends or jumps."""
        path = np.empty((len(X_WE), len(q)))
        for k, X in enumerate(X_WE):
            found = self._inverse.followed(X, q)
            if found is None:
                return None
            q = path[k] = found
        return path
